#include "hlm/ve_client/scene/sdf_messages.h"

#include <iostream>
#include <stdexcept>

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

void require_none(const sdf::Errors& errors) {
  if (!errors.empty()) throw std::runtime_error(errors.front().Message());
}

}  // namespace hlm::ve
