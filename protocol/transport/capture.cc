#include "hlm/protocol/transport/capture.h"

#include <array>
#include <cassert>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>

#include <pcap/pcap.h>
#include <unistd.h>
#include <zlib.h>

#include "hlm/protocol/transport/ip_packet.h"

namespace hlm::protocol {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
constexpr int kSnapshotLength = 262'144;  // As tcpdump's; a packet is never cut.

/// Latest stamp, s since the epoch: in 2262, the last of which the nanoseconds are a number.
constexpr std::int64_t kLatestStamp =
    std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond - 1;

bool is_stamp(const timeval& time) {
  return time.tv_sec >= 0 && time.tv_sec <= kLatestStamp && time.tv_usec >= 0 &&
         time.tv_usec < kNanosecondsPerSecond;
}

std::runtime_error file_error(const std::string& action, const std::string& path,
                              const std::string& why) {
  return std::runtime_error("cannot " + action + " capture file '" + path + "': " + why);
}

/// "-" is the process's standard stream of that number.
gzFile open_gz(const std::string& action, const std::string& path, const char* mode, int standard) {
  errno = ENOMEM;  // zlib's only other reason.
  const gzFile file = path == "-" ? gzdopen(dup(standard), mode) : gzopen(path.c_str(), mode);
  if (file == nullptr) throw file_error(action, path, std::strerror(errno));
  return file;
}

/// What libpcap reads or writes; it closes `file`.
std::FILE* stream(gzFile file, const char* mode) {
  std::FILE* const made = fopencookie(
      file, mode,
      {.read = [](void* of, char* bytes, std::size_t size) -> ssize_t {
         errno = 0;
         const int read = gzread(static_cast<gzFile>(of), bytes, static_cast<unsigned>(size));
         if (read < 0 && errno == 0) errno = EBADMSG;  // It is damaged.
         return read;
       },
       .write = [](void* of, const char* bytes, std::size_t size) -> ssize_t {
         return gzwrite(static_cast<gzFile>(of), bytes, static_cast<unsigned>(size));
       },
       .seek = nullptr,
       .close = [](void* of) { return gzclose(static_cast<gzFile>(of)) == Z_OK ? 0 : EOF; }});
  if (made == nullptr) throw std::bad_alloc();
  return made;
}

}  // namespace

void CaptureWriter::Close::operator()(pcap_dumper* file) const noexcept { pcap_dump_close(file); }

CaptureWriter::CaptureWriter(const std::filesystem::path& path) : path_(path.string()) {
  const std::unique_ptr<pcap_t, decltype(&pcap_close)> format(
      pcap_open_dead_with_tstamp_precision(DLT_RAW, kSnapshotLength, PCAP_TSTAMP_PRECISION_NANO),
      &pcap_close);
  // The quickest way to pack, or none.
  gz_ = open_gz("write", path_, path_.ends_with(".gz") ? "wb1" : "wbT", STDOUT_FILENO);
  file_.reset(pcap_dump_fopen(format.get(), stream(gz_, "wb")));
  if (!file_) throw file_error("write", path_, pcap_geterr(format.get()));
  flush();
}

void CaptureWriter::write(std::int64_t time_ns, const Endpoint& from, const Endpoint& to,
                          std::span<const std::byte> bytes) {
  assert(time_ns >= 0 && bytes.size() <= kMaxDatagram);
  StaticVector<std::byte, kIpUdpHeaderSize + kMaxDatagram> packet;
  const auto header = ip_udp_header(from, to, bytes);
  packet.insert(packet.end(), header.begin(), header.end());
  packet.insert(packet.end(), bytes.begin(), bytes.end());

  pcap_pkthdr record{};
  record.ts.tv_sec = time_ns / kNanosecondsPerSecond;
  record.ts.tv_usec = time_ns % kNanosecondsPerSecond;  // Nanoseconds, as the file says.
  record.caplen = record.len = static_cast<bpf_u_int32>(packet.size());
  pcap_dump(reinterpret_cast<u_char*>(file_.get()), &record,
            reinterpret_cast<const u_char*>(packet.data()));
}

void CaptureWriter::flush() {
  const bool flushed = pcap_dump_flush(file_.get()) == 0 && gzflush(gz_, Z_SYNC_FLUSH) == Z_OK;
  if (!flushed || std::ferror(pcap_dump_file(file_.get())) != 0) {
    throw file_error("write", path_, "the system refuses more data (is the disk full?)");
  }
}

void CaptureReader::Close::operator()(pcap* file) const noexcept { pcap_close(file); }

CaptureReader::CaptureReader(const std::filesystem::path& path) : path_(path.string()) {
  std::array<char, PCAP_ERRBUF_SIZE> why{};
  std::unique_ptr<std::FILE, decltype(&std::fclose)> unpacked(
      stream(open_gz("read", path_, "rb", STDIN_FILENO), "rb"), &std::fclose);
  file_.reset(pcap_fopen_offline_with_tstamp_precision(unpacked.get(), PCAP_TSTAMP_PRECISION_NANO,
                                                       why.data()));
  if (file_) static_cast<void>(unpacked.release());  // It closes it.
  if (!file_) throw file_error("read", path_, why.data());
  link_type_ = pcap_datalink(file_.get());
  if (!is_known_link_type(link_type_)) {
    const char* const name = pcap_datalink_val_to_name(link_type_);
    throw file_error("read", path_,
                     "its packets are of link type " +
                         (name != nullptr ? name : std::to_string(link_type_)) +
                         "; allowed are raw IP, Ethernet, Linux cooked (SLL, SLL2) and loopback");
  }
}

std::optional<CapturedDatagram> CaptureReader::next() {
  pcap_pkthdr* record = nullptr;
  const u_char* data = nullptr;
  int status = 0;
  while ((status = pcap_next_ex(file_.get(), &record, &data)) == 1) {
    const auto frame = std::as_bytes(std::span(data, record->caplen));
    const auto packet = find_ipv4(link_type_, frame);
    const auto udp = packet ? find_udp(*packet) : std::nullopt;
    if (!udp || !is_stamp(record->ts)) {
      ++skipped_;
      continue;
    }
    CapturedDatagram datagram{
        .time_ns = record->ts.tv_sec * kNanosecondsPerSecond + record->ts.tv_usec,
        .from = udp->from,
        .to = udp->to,
        .bytes = {}};
    if (udp->payload.size() <= kMaxDatagram) {
      datagram.bytes.assign(udp->payload.begin(), udp->payload.end());
    }
    return datagram;
  }
  if (status == PCAP_ERROR_BREAK) return {};
  // The writer was interrupted: the file ends within a packet.
  if (std::feof(pcap_file(file_.get())) != 0) {
    ++skipped_;
    return {};
  }
  throw file_error("read", path_, pcap_geterr(file_.get()));
}

}  // namespace hlm::protocol
