#include "hlm/client/session_news.h"

#include <utility>

namespace hlm {
namespace {

/// A server has so long to answer, s: it is asked several times.
constexpr double kPatience = 1;
constexpr const char* kLooseJoints =
    "the server knows no drives: the joints that they move are loose";

std::string judge(const protocol::Reject& reject) {
  const std::string text(reject.text.begin(), reject.text.end());
  return "the server gives no session: " +
         (text.empty() ? std::string(meaning_of(reject.reason)) : text);
}

std::string judge(const protocol::Refusal& refusal) {
  const std::string why(meaning_of(refusal.error));
  return refusal.whole ? why : "contact " + std::to_string(refusal.item) + ": " + why;
}

}  // namespace

void SessionNews::hear(double now, const HapticClient& client, const HapticClient::Inbox& inbox) {
  if (inbox.lost || inbox.welcomed) {
    text_.clear();
    asked_at_.reset();
  }
  if (inbox.reject) {
    text_ = judge(*inbox.reject);
    asked_at_ = now;
  } else if (inbox.refusal) {
    text_ = judge(*inbox.refusal);
  }
  if (client.connected()) {
    had_session_ = true;
    if (text_.empty()) text_ = client.scene_problem();
    if (text_.empty() && client.drives_in_vain()) text_ = kLooseJoints;
    return;
  }
  if (!asked_at_) asked_at_ = now;
  if (now - *asked_at_ > kPatience) text_ = silence();
}

std::string SessionNews::silence() const {
  const std::string key = key_file_.empty()
                              ? "it has a key, which is needed here, too"
                              : "its key is not that of " + key_file_ + ", or it has none";
  return "no server answers at " + server_ + (had_session_ ? " any more" : "") +
         ": haptic_server does not run there, the network is in the way, or " + key;
}

}  // namespace hlm
