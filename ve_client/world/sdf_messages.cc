#include "ve_client/world/sdf_messages.h"

#include <iostream>
#include <stdexcept>

#include "common/one_line.h"

namespace hlm::ve {

std::mutex CapturedMessages::mutex_;

CapturedMessages::CapturedMessages() : lock_(mutex_), original_(std::cerr.rdbuf(text_.rdbuf())) {}

CapturedMessages::~CapturedMessages() { std::cerr.rdbuf(original_); }

std::string CapturedMessages::first_error() const {
  // One message: <colour>Error [file:line]<colour> text.
  constexpr std::string_view kPositionEnd = "]\033[0m ";
  const std::string text = text_.str();
  const std::size_t error = text.find("Error [");
  if (error == text.npos) return "";
  const std::size_t position_end = text.find(kPositionEnd, error);
  if (position_end == text.npos) return "";
  const std::size_t begin = position_end + kPositionEnd.size();
  return text.substr(begin, text.find('\n', begin) - begin);
}

void require_none(const sdf::Errors& errors, const std::string& where, const std::string& detail) {
  if (errors.empty()) return;
  const sdf::Error& first = errors.front();
  std::string message = where + ": " + first.Message();
  if (first.LineNumber()) message += " in line " + std::to_string(*first.LineNumber());
  if (!detail.empty()) message += ": " + detail;
  throw std::runtime_error(one_line(message));
}

}  // namespace hlm::ve
