// Every tick's signals and loaded contacts as they are played, for programs in other languages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// The stream is a line that describes it, JSON, and blocks until its end. The line has the loop's
/// "period_s", and under "ticks" and "contacts" the fields of the two kinds of records, [name,
/// type] each, with types as numpy writes them. A block is two u32, how many ticks and contacts it
/// has, the ticks' records, and those of their contacts, of which each tick says how many are its
/// own. Everything is little-endian and without gaps; names end in units, axes are the world's.
class SignalStream {
 public:
  /// file: "-" is standard output. period: of the loop, s. Throws std::runtime_error naming the
  /// file if it cannot be written.
  SignalStream(const std::string& file, double period);

  /// A tick that the servo has just done. Throws std::runtime_error naming the file if a block
  /// cannot be written.
  void observe(const TickRecord& record, const Servo& servo);
  /// Writes what is left, with the same errors.
  void close();

 private:
  void write_block();
  void write(const char* data, std::size_t size);
  void check() const;

  std::string name_;
  std::ofstream file_;
  std::ostream& out_;
  std::vector<double> numbers_;
  std::uint32_t tick_count_ = 0;
  std::uint32_t contact_count_ = 0;
  std::vector<char> ticks_;     ///< Records of the block that is being filled,
  std::vector<char> contacts_;  ///< and of its contacts.
};

}  // namespace hlm::server
