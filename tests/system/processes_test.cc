// The real programs, over UDP on loopback.
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <thread>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/transport/capture.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;

using Arguments = std::vector<std::string>;

Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::string address(int port) { return "127.0.0.1:" + std::to_string(port); }

Arguments server(int port) {
  return {HLM_SERVER, "--listen", address(port), "--rate", "500",
          "--status", "false",    "--max-gap",   "5"};
}

Arguments client(int port) {
  return {HLM_CLIENT, "--server", address(port), "--world", HLM_WORLDS "/testbed.sdf"};
}

/// The last row of a tick log in a session, by column.
std::map<std::string, std::string> last_session_tick(const std::string& path) {
  std::ifstream file(path);
  std::string header;
  std::getline(file, header);
  std::string line;
  std::map<std::string, std::string> last;
  while (std::getline(file, line)) {
    std::istringstream names(header);
    std::istringstream values(line);
    std::map<std::string, std::string> row;
    std::string name;
    std::string value;
    while (std::getline(names, name, ',') && std::getline(values, value, ',')) row[name] = value;
    if (row["server_state"] == "active") last = row;
  }
  return last;
}

double number(const std::map<std::string, std::string>& row, const std::string& column) {
  INFO("column " << column);
  REQUIRE(row.count(column) == 1);
  return std::stod(row.at(column));
}

TEST_CASE("Pressed on a wall: force within 2 % of the push, separation within 2 % of -f/k") {
  const bool shapes = GENERATE(false, true);  // The server finds the contacts itself.
  const TemporaryDirectory directory;
  std::ofstream(directory.file("push.toml")) << "after = \"hold\"\n[[segment]]\nduration = 1.0\n"
                                                "wrench = { force = [0, 0.5, 0] }\n";
  const int port = free_port();
  Process haptic_server(server(port) + Arguments{"--hand", directory.file("push.toml"), "--log",
                                                 directory.file("ticks.csv"), "--device-option",
                                                 "friction=0"});
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  Arguments client_of_wall = client(port) + Arguments{"--duration", "6"};
  if (!shapes) client_of_wall.push_back("--contacts");
  const Finished session = run(client_of_wall, 30);
  CHECK(session.exit_code == 0);
  haptic_server.send_signal(SIGTERM);
  CHECK(haptic_server.wait(10) == 0);

  const auto row = last_session_tick(directory.file("ticks.csv"));
  CHECK(number(row, "scene") == (shapes ? 1 : 0));
  CHECK(number(row, "env_force_y_N") == Approx(-0.5).epsilon(0.02));
  CHECK(number(row, "active_contacts") == 2);
  CHECK(number(row, "smallest_separation_m") == Approx(-0.5 / 2 / 4000).epsilon(0.02));
  CHECK(number(row, "dropped") == 0);
}

TEST_CASE("A recorded run in which both sides stalled replays offline bit for bit") {
  const bool shapes = GENERATE(false, true);
  const TemporaryDirectory directory;
  const int port = free_port();
  // It touches within half a second, so that other options would have changed what was felt.
  std::ofstream(directory.file("push.toml")) << "after = \"hold\"\n[[segment]]\nduration = 1.0\n"
                                                "wrench = { force = [0, 2, 0] }\n";
  const Arguments physics{"--hand", directory.file("push.toml")};
  {
    Process haptic_server(server(port) + physics +
                          Arguments{"--record", directory.file("run.pcap")});
    REQUIRE(haptic_server.wait_for_error("listening", 10));
    Arguments stalled = client(port) + Arguments{"--duration", "3"};
    if (!shapes) stalled.push_back("--contacts");
    Process haptic_client(stalled);
    // Both stall, long enough that force fades.
    std::this_thread::sleep_for(std::chrono::milliseconds(1000));
    for (Process* side : {&haptic_client, &haptic_server}) {
      side->send_signal(SIGSTOP);
      std::this_thread::sleep_for(std::chrono::milliseconds(400));
      side->send_signal(SIGCONT);
      std::this_thread::sleep_for(std::chrono::milliseconds(400));
    }
    CHECK(haptic_client.wait(30) == 0);
    haptic_server.send_signal(SIGINT);
    CHECK(haptic_server.wait(10) == 0);
  }
  const Finished offline = run(Arguments{HLM_REPLAY, directory.file("run.pcap"), "--offline",
                                         "--rate", "500", "--max-gap", "5"} +
                               physics);
  INFO(offline.output << offline.error);
  CHECK(offline.exit_code == 0);
  CHECK_THAT(offline.output, ContainsSubstring("equal bit for bit"));
  CHECK_THAT(offline.error, !ContainsSubstring("warning"));

  const Finished different = run(Arguments{HLM_REPLAY, directory.file("run.pcap"), "--offline",
                                           "--rate", "500", "--stiffness", "3000"});
  CHECK(different.exit_code == 3);
  CHECK_THAT(different.error, ContainsSubstring("recorded with other options"));
}

TEST_CASE("A live replay says whether the server's answers are the recorded ones") {
  const TemporaryDirectory directory;
  const int port = free_port();
  // So slow that a stall of the machine for 50 ms moves nothing by a millimetre.
  std::ofstream(directory.file("slow.toml")) << "after = \"hold\"\n[[segment]]\nduration = 3.0\n"
                                                "move_to = { position = [0.03, 0, 0] }\n";
  const Arguments physics{"--hand", directory.file("slow.toml")};
  {
    Process haptic_server(server(port) + physics +
                          Arguments{"--record", directory.file("run.pcap")});
    REQUIRE(haptic_server.wait_for_error("listening", 10));
    // The tick at which a scene comes into force is not the recorded one.
    CHECK(run(client(port) + Arguments{"--duration", "3", "--contacts"}, 30).exit_code == 0);
  }
  const Arguments replay{HLM_REPLAY, directory.file("run.pcap"), "--server", address(port)};
  {
    Process same_server(server(port) + physics);
    REQUIRE(same_server.wait_for_error("listening", 10));
    const Finished live = run(replay);
    INFO(live.output << live.error);
    CHECK(live.exit_code == 0);
    CHECK_THAT(live.output, ContainsSubstring(" 0 not whole"));
    CHECK(live.error.empty());

    const Finished hurried = run(replay + Arguments{"--speed", "2"});
    INFO(hurried.output << hurried.error);
    CHECK(hurried.exit_code == 3);
    CHECK_THAT(hurried.error, ContainsSubstring("--speed 2") && ContainsSubstring("not in step"));
    CHECK_THAT(hurried.error,
               ContainsSubstring("not the recorded ones") && ContainsSubstring("mm"));
  }
  Process other_server({HLM_SERVER, "--listen", address(port), "--status", "false"});
  REQUIRE(other_server.wait_for_error("listening", 10));
  Process other(replay);
  REQUIRE(other.wait_for_error("1000 Hz, the recorded one ran at 500 Hz", 10));
  other_server.send_signal(SIGTERM);
  CHECK(other.wait(10) == 1);
  CHECK_THAT(other.error(), ContainsSubstring("ended the session"));
}

TEST_CASE("Either side starts first, and either may be restarted") {
  const int port = free_port();
  Process haptic_client(client(port) + Arguments{"--duration", "60", "--connect-timeout", "30"});
  {
    Process first_server(server(port));
    REQUIRE(first_server.wait_for_error("begins", 10));
    first_server.send_signal(SIGTERM);
    REQUIRE(first_server.wait(10) == 0);
  }
  Process second_server(server(port));
  REQUIRE(second_server.wait_for_error("begins", 10));

  REQUIRE(second_server.wait_for_error("force is on", 10));
  haptic_client.send_signal(SIGKILL);  // It dies without a goodbye.
  haptic_client.wait(5);
  REQUIRE(second_server.wait_for_error("force fades to zero", 10));
  Process next_client(client(port) + Arguments{"--duration", "2"});
  CHECK(next_client.wait(20) == 0);
  CHECK(second_server.running());
}

TEST_CASE("A second client is turned away while the first is alive") {
  const int port = free_port();
  Process haptic_server(server(port));
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  Process first(client(port) + Arguments{"--duration", "30"});
  REQUIRE(haptic_server.wait_for_error("begins", 10));
  const Finished second = run(client(port) + Arguments{"--connect-timeout", "1"});
  CHECK(second.exit_code == 3);
  CHECK_THAT(second.error, ContainsSubstring("busy with another client"));
  CHECK(first.running());
}

/// Sends what `next` gives to a port of loopback, `count` times.
template <class Next>
void send_datagrams(int port, int count, Next next) {
  const int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (int i = 0; i < count; ++i) {
    const std::string bytes = next();
    sendto(descriptor, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&to), sizeof to);
  }
  close(descriptor);
}

TEST_CASE("A client without a page ends with the server's reason where its tool is refused") {
  const int port = free_port();
  const Process direct(server(port) + Arguments{"--controller", "direct"});
  REQUIRE(direct.wait_for_error("listening", 10));
  Process linkage({HLM_CLIENT, "--server", address(port), "--world", HLM_WORLDS "/linkage.sdf"});
  CHECK(linkage.wait(10) == 1);
  CHECK_THAT(linkage.error(),
             ContainsSubstring("cannot use the tool: this controller needs a tool of one link"));
}

TEST_CASE("Garbage and floods change counters, not the session") {
  Random random;
  const TemporaryDirectory directory;
  const int port = free_port();
  Process haptic_server(server(port) + Arguments{"--log", directory.file("ticks.csv")});
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  Process haptic_client(client(port) + Arguments{"--duration", "3"});
  REQUIRE(haptic_server.wait_for_error("begins", 10));
  send_datagrams(port, 20'000, [&] {
    std::string bytes(static_cast<std::size_t>(random.integer(0, 1400)), '\0');
    for (char& byte : bytes) byte = static_cast<char>(random.integer(-128, 127));
    if (bytes.size() > 4 && random.integer(0, 1) == 1) bytes.replace(0, 4, "HLMI");
    return bytes;
  });
  CHECK(haptic_client.wait(20) == 0);
  haptic_server.send_signal(SIGTERM);
  CHECK(haptic_server.wait(10) == 0);
  const auto row = last_session_tick(directory.file("ticks.csv"));
  CHECK(number(row, "dropped") > 100);
  CHECK(number(row, "step") > 500);
  CHECK_THAT(haptic_server.output(), ContainsSubstring(" not ours"));
  CHECK_THAT(haptic_client.error(), ContainsSubstring("connected | 0 dropped"));
}

TEST_CASE("A client whose duration ends before any server answers ends with status 3") {
  const int nobody = free_port();
  const Finished finished = run(client(nobody) + Arguments{"--duration", "1.5"});
  CHECK(finished.exit_code == 3);
  CHECK_THAT(finished.error, ContainsSubstring("waiting for server " + address(nobody)) &&
                                 ContainsSubstring("has not answered in 1.5 s"));
}

TEST_CASE("A client whose terminal goes says goodbye") {
  const int port = free_port();
  Process haptic_server(server(port));
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  Process haptic_client(client(port));
  REQUIRE(haptic_client.wait_for_error("began", 10));
  haptic_client.send_signal(SIGHUP);
  CHECK(haptic_client.wait(10) == 0);
  CHECK(haptic_server.wait_for_error("is over", 10));
}

TEST_CASE("A client's goodbye is no warning") {
  const int port = free_port();
  Process haptic_server(server(port) + Arguments{"--realtime", "off"});
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  CHECK(run(client(port) + Arguments{"--duration", "1"}).exit_code == 0);
  REQUIRE(haptic_server.wait_for_error("info: the client said goodbye", 10));
  CHECK(haptic_server.wait_for_error("is over", 10));
  const std::string log = haptic_server.error();  // Before it, a busy machine may be warned of.
  CHECK_THAT(log.substr(log.find("the client said goodbye")), !ContainsSubstring("warning"));
}

TEST_CASE("Every signal that ends the server says goodbye to the client first") {
  const int signal = GENERATE(SIGHUP, SIGINT, SIGQUIT, SIGTERM);
  INFO("signal " << signal);
  const TemporaryDirectory directory;
  const int port = free_port();
  Process haptic_server(server(port) + Arguments{"--record", directory.file("run.pcap")});
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  Process haptic_client(client(port) + Arguments{"--duration", "30"});
  REQUIRE(haptic_server.wait_for_error("begins", 10));
  haptic_server.send_signal(signal);
  CHECK(haptic_server.wait(10) == 0);
  CHECK_THAT(haptic_server.output(), ContainsSubstring("updates adopted"));

  protocol::CaptureReader capture(directory.file("run.pcap"));
  bool said_goodbye = false;
  while (const auto datagram = capture.next()) {
    if (datagram->from == datagram->to) continue;  // A note.
    protocol::Header header;
    REQUIRE_FALSE(decode_header(protocol::view(datagram->bytes), header));
    said_goodbye = datagram->from.port == port && header.type == protocol::MessageType::kGoodbye;
  }
  CHECK(said_goodbye);
}

TEST_CASE("A server started to outlive its terminal ignores the hang-up") {
  const int port = free_port();
  Process haptic_server(Arguments{"nohup"} + server(port));
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  haptic_server.send_signal(SIGHUP);
  CHECK(haptic_server.wait(0.5) == -1);
  haptic_server.send_signal(SIGTERM);
  CHECK(haptic_server.wait(10) == 0);
}

TEST_CASE("A file that cannot grow is reported at once, the session goes on, the summary comes") {
  const std::string option = GENERATE("--log", "--record");
  const TemporaryDirectory directory;
  const int port = free_port();
  Process haptic_server(Arguments{"prlimit", "--fsize=20000"} + server(port) +
                        Arguments{option, directory.file("file")});
  Process haptic_client(client(port) + Arguments{"--duration", "3"});
  REQUIRE(haptic_server.wait_for_error("error: ", 10));
  CHECK_THAT(haptic_server.error(),
             ContainsSubstring(directory.file("file")) && ContainsSubstring("the session goes on"));
  CHECK(haptic_client.wait(20) == 0);
  REQUIRE(haptic_server.wait_for_error("said goodbye", 10));
  haptic_server.send_signal(SIGTERM);
  CHECK(haptic_server.wait(10) == 1);
  CHECK_THAT(haptic_server.output(), ContainsSubstring("updates adopted"));
}

/// Whether a process has the file open that keeps processors awake.
bool holds_cpu_latency(pid_t process) {
  for (const auto& file :
       std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/fd")) {
    std::error_code gone;
    if (std::filesystem::read_symlink(file.path(), gone) == "/dev/cpu_dma_latency") return true;
  }
  return false;
}

/// The machine's limit, µs.
std::int32_t cpu_latency_limit() {
  std::int32_t limit = -1;
  const int file = open("/dev/cpu_dma_latency", O_RDONLY);
  CHECK(read(file, &limit, sizeof limit) == sizeof limit);
  close(file);
  return limit;
}

TEST_CASE("Processors are kept awake while a session runs, and only then") {
  if (access("/dev/cpu_dma_latency", W_OK) != 0) {
    WARN("SKIPPED: /dev/cpu_dma_latency cannot be written");
    return;
  }
  const int port = free_port();
  Process haptic_server(server(port));
  REQUIRE(haptic_server.wait_for_error("listening", 10));
  CHECK_FALSE(wait_until(0.3, [&] { return holds_cpu_latency(haptic_server.id()); }));
  Process haptic_client(client(port) + Arguments{"--duration", "2"});
  REQUIRE(wait_until(10, [&] { return holds_cpu_latency(haptic_server.id()); }));
  CHECK(cpu_latency_limit() == 0);
  CHECK(haptic_client.wait(20) == 0);
  REQUIRE(haptic_server.wait_for_error("is over", 10));
  CHECK(wait_until(5, [&] { return !holds_cpu_latency(haptic_server.id()); }));
}

/// Exit statuses of a refusal.
constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr int kNeverAnswered = 3;

/// A program that must refuse: its exit status, or any but 0, and one line on stderr with all these
/// texts.
void refuses(const Arguments& arguments, const std::vector<std::string>& texts,
             std::optional<int> exit_code = {}) {
  const Finished finished = run(arguments);
  INFO(finished.error);
  CHECK(finished.exit_code != 0);
  CHECK(finished.exit_code != -1);
  if (exit_code) CHECK(finished.exit_code == *exit_code);
  CHECK(std::count(finished.error.begin(), finished.error.end(), '\n') == 1);
  for (const std::string& text : texts) CHECK_THAT(finished.error, ContainsSubstring(text));
}

TEST_CASE("Bad options of the server: one line that names the thing and what is allowed") {
  refuses({HLM_SERVER, "--bogus"}, {"--bogus"}, kUsage);
  refuses({HLM_SERVER, "--rate", "50"}, {"--rate 50 Hz must be 100 to 8000 Hz"}, kUsage);
  refuses({HLM_SERVER, "--stiffness", "-1"}, {"--stiffness -1 N/m must be 1 to 1000000 N/m"},
          kUsage);
  refuses({HLM_SERVER, "--controller", "magic"}, {"--controller", "magic", "four_channel"}, kUsage);
  refuses({HLM_SERVER, "--final-spin", "0.6e-3"}, {"final spin 0.0006", "0.0005 s"}, kUsage);
  refuses({HLM_SERVER, "--hand", "/nowhere.toml"}, {"/nowhere.toml"}, kUsage);
  refuses({HLM_SERVER, "--listen", "127.0.0.1"}, {"127.0.0.1"}, kUsage);
  refuses({HLM_SERVER, "--device", "replay"}, {"--device replay must be one of"}, kUsage);
  refuses({HLM_SERVER, "--config", "/nowhere.toml"}, {"/nowhere.toml"}, kUsage);
  refuses({HLM_SERVER, "--record", "/nowhere/file.pcap"}, {"/nowhere/file.pcap"}, kFailed);
  refuses({HLM_SERVER, "--log", "/dev/full"}, {"/dev/full", "No space left"}, kFailed);
  refuses({HLM_SERVER, "--log", "x.csv", "--record", "x.csv"}, {"two files", "x.csv"}, kUsage);

  const TemporaryDirectory directory;
  std::ofstream(directory.file("bad.toml")) << "stiffnes=4000\n";
  refuses({HLM_SERVER, "--config", directory.file("bad.toml")},
          {"bad.toml:1: unknown key 'stiffnes'", "'stiffness'"}, kUsage);
  std::ofstream(directory.file("broken.toml")) << "stiffness = 4000\ndamping = \n";
  refuses({HLM_SERVER, "--config", directory.file("broken.toml")}, {"broken.toml:2: "}, kUsage);
}

TEST_CASE("Without a key an address that others can reach is refused, with the two ways out") {
  for (const char* address : {"0.0.0.0:47800", "192.0.2.1:47800"}) {
    refuses({HLM_SERVER, "--listen", address},
            {address, "not loopback", "--key-file", "haptic_keygen", "--insecure"}, kUsage);
  }
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  const std::string any_address = "0.0.0.0:" + std::to_string(free_port());
  const Arguments listening{HLM_SERVER, "--listen", any_address, "--duration", "0.2"};
  const Finished insecure = run(listening + Arguments{"--insecure"});
  CHECK(insecure.exit_code == 0);
  const std::string warning = "--insecure: no key: whoever reaches " + any_address;
  CHECK_THAT(insecure.error, ContainsSubstring(warning) && ContainsSubstring("move the device"));
  CHECK(insecure.error.find(warning) == insecure.error.rfind(warning));
  CHECK(run(listening + Arguments{"--key-file", key}).exit_code == 0);
  refuses(listening + Arguments{"--insecure", "--key-file", key}, {"--insecure", "--key-file"},
          kUsage);
}

TEST_CASE("A server at all addresses answers from the one that a client asks, sealed or not") {
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  const bool sealed = GENERATE(false, true);
  const Arguments with = sealed ? Arguments{"--key-file", key} : Arguments{};
  const Arguments access = sealed ? with : Arguments{"--insecure"};
  const std::string port = std::to_string(free_port());
  Process server(Arguments{HLM_SERVER, "--listen", "0.0.0.0:" + port, "--status", "false"} +
                 access);
  REQUIRE(server.wait_for_error("listening", 10));
  Process client(
      Arguments{HLM_CLIENT, "--server", "127.0.0.2:" + port, "--world", HLM_WORLDS "/testbed.sdf"} +
      with);
  CHECK(client.wait_for_error("began", 10));
}

TEST_CASE(
    "A key that others can read, or that is none, is refused by both sides, none is replaced") {
  const TemporaryDirectory directory;
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  refuses({HLM_KEYGEN, key}, {key, "exists"}, kFailed);
  std::filesystem::permissions(key, std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  refuses({HLM_SERVER, "--key-file", key}, {key, "0640", "chmod 600"}, kUsage);
  refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--key-file", key},
          {key, "0640", "chmod 600"}, kUsage);
  refuses({HLM_SERVER, "--key-file", directory.file("none")}, {"none", "No such file"}, kUsage);
  const std::string zeros = directory.file("zeros");
  std::ofstream(zeros) << "haptic key 1\n" << std::string(64, '0') << '\n';
  std::filesystem::permissions(zeros, std::filesystem::perms::owner_read);
  refuses({HLM_SERVER, "--key-file", zeros}, {zeros, "one byte repeated"}, kUsage);
  refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--key-file", zeros},
          {zeros, "one byte repeated"}, kUsage);
}

TEST_CASE("An IPv6 address is refused as one, by both sides and for the page") {
  for (const char* address : {"[::1]:47800", "::1:47800", "::1"}) {
    refuses({HLM_SERVER, "--listen", address}, {address, "IPv6", "only IPv4"}, kUsage);
    refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--server", address},
            {address, "IPv6", "only IPv4"}, kUsage);
    refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--page", address},
            {address, "IPv6", "only IPv4"}, kUsage);
  }
}

TEST_CASE("A sealed session's recording holds what was said, and is replayed offline and live") {
  const TemporaryDirectory directory;
  const int port = free_port();
  const std::string key = directory.file("haptic.key");
  REQUIRE(run({HLM_KEYGEN, key}).exit_code == 0);
  const Arguments sealed{"--key-file", key};
  const std::string capture = directory.file("run.pcap");
  {
    Process haptic_server(server(port) + sealed + Arguments{"--record", capture});
    REQUIRE(haptic_server.wait_for_error("listening", 10));
    const std::string clients = directory.file("client.pcap");
    const Arguments recorded{"--duration", "2", "--record", clients};
    CHECK(run(client(port) + sealed + recorded, 30).exit_code == 0);
    const Finished live =
        run(Arguments{HLM_REPLAY, clients, "--server", address(port)} + sealed, 30);
    INFO(live.output << live.error);
    CHECK_THAT(live.output, ContainsSubstring(" 0 not whole"));
    CHECK_THAT(live.error, !ContainsSubstring("granted no session"));
  }
  const Finished offline =
      run({HLM_REPLAY, capture, "--offline", "--rate", "500", "--max-gap", "5"}, 30);
  INFO(offline.output << offline.error);
  CHECK(offline.exit_code == 0);
  CHECK_THAT(offline.output, ContainsSubstring("equal bit for bit"));
}

TEST_CASE("An address of many machines is refused by its kind") {
  refuses({HLM_SERVER, "--insecure", "--listen", "239.1.2.3:47800"},
          {"239.1.2.3:47800", "multicast"}, kFailed);
  for (const char* broadcast : {"127.255.255.255:47800", "255.255.255.255:47800"}) {
    refuses({HLM_SERVER, "--insecure", "--listen", broadcast, "--duration", "0.1"},
            {broadcast, "broadcast"}, kFailed);
  }
}

TEST_CASE("A port in use is named") {
  const int port = free_port();
  Process first(server(port));
  REQUIRE(first.wait_for_error("listening", 10));
  refuses(server(port), {address(port)}, kFailed);
}

TEST_CASE("Bad options of the client: one line that names the thing and what is allowed") {
  refuses({HLM_CLIENT, "--world", "/nowhere.sdf"}, {"/nowhere.sdf"});
  refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--tool", "hammer"},
          {"hammer", "peg"});
  const TemporaryDirectory worlds;
  std::ofstream(worlds.file("plain.sdf")) << "<sdf version='1.9'><world name='w'><model "
                                             "name='brick'><link name='l'/></model></world></sdf>";
  refuses({HLM_CLIENT, "--world", worlds.file("plain.sdf")},
          {"plain.sdf", "--tool", "<haptic:tool>", "brick"});
  refuses({HLM_CLIENT, "--bogus"}, {"--bogus"});
  refuses({HLM_CLIENT, "--world", HLM_WORLDS "/testbed.sdf", "--epsilon", "2"}, {"epsilon"});
  const int nobody = free_port();
  refuses(client(nobody) + Arguments{"--quiet", "--connect-timeout", "0.4"}, {address(nobody)},
          kNeverAnswered);

  const TemporaryDirectory directory;
  std::ofstream(directory.file("bad.toml")) << "epsilom=0.005\n";
  refuses({HLM_CLIENT, "--config", directory.file("bad.toml")},
          {"bad.toml:1: unknown key 'epsilom'", "'epsilon'"});
}

TEST_CASE("A capture of something else is refused") {
  const TemporaryDirectory directory;
  std::ofstream(directory.file("notes.txt")) << "not a capture\n";
  refuses({HLM_REPLAY, directory.file("notes.txt"), "--offline"}, {"notes.txt"}, kFailed);
  refuses({HLM_REPLAY, "/nowhere.pcap", "--offline"}, {"/nowhere.pcap"}, kFailed);
  refuses({HLM_REPLAY}, {"CAPTURE is missing"}, kUsage);
}

TEST_CASE("The printed configuration is one that the program reads") {
  const TemporaryDirectory directory;
  for (const char* program : {HLM_SERVER, HLM_CLIENT}) {
    const Finished printed = run({program, "--print-config"});
    CHECK(printed.exit_code == 0);
    std::ofstream(directory.file("printed.toml")) << printed.output;
    const Finished again =
        run({program, "--config", directory.file("printed.toml"), "--print-config"});
    INFO(again.error);
    CHECK(again.exit_code == 0);
    CHECK(again.output == printed.output);
  }
}

}  // namespace
}  // namespace hlm::test
