// How the server is, in a file that haptic_doctor and scripts read.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>

#include "hlm/common/force_chain.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/report/histogram.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// What of a server does not change while it runs.
struct ServerFacts {
  std::string listen;            ///< ADDRESS:PORT.
  double rate = 1000;            ///< Hz.
  double least_update_rate = 4;  ///< Rate of updates below which force comes and goes, Hz.
  std::string device;
  DeviceRatings ratings;
  std::string capture;  ///< File to which all datagrams are recorded, absolute; empty: none.
};

/// ADDRESS:PORT and this is its name.
inline constexpr const char* kStateSuffix = ".json";

/// Replaces a JSON file once a second, as a whole, and removes it at its end. docs/operations.md
/// has its fields. A file that cannot be written is not missed. Not for the servo thread.
class StateFile {
 public:
  static constexpr double kPeriod = 1;  ///< s.

  StateFile(const std::filesystem::path& directory, ServerFacts facts);
  ~StateFile();
  StateFile(const StateFile&) = delete;
  StateFile& operator=(const StateFile&) = delete;

  /// Every tick, in order.
  void observe(const TickRecord& record);

 private:
  void count(const TickRecord& record);
  ForceFacts force_facts(const TickRecord& record) const;
  /// `load`: share of one processor since the latest writing.
  std::string text(const TickRecord& record, double load) const;
  void write(const std::string& text) const;

  std::filesystem::path path_;  ///< Empty: none is written.
  ServerFacts facts_;
  std::uint64_t session_ = 0;
  double began_ = 0;              ///< The session, s.
  double heard_ = 0;              ///< When something usable came last, s.
  std::uint64_t usable_ = 0;      ///< Datagrams received and not dropped.
  std::deque<double> adoptions_;  ///< Times of the updates taken recently, s.
  double age_ = 0;                ///< Age of the latest update, s.
  Histogram lateness_;            ///< Lateness since the latest writing.
  std::uint64_t missed_ = 0;      ///< Periods, until the latest writing.
  double processor_time_;         ///< That this process had then, s.
  double written_ = 0;            ///< s.
};

}  // namespace hlm::server
