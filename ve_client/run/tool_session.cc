#include "hlm/ve_client/run/tool_session.h"

#include <utility>

#include <spdlog/spdlog.h>

#include "hlm/common/settings/table.h"

namespace hlm::ve {

protocol::Endpoint resolved(const char* option, const std::string& value, const char* example) {
  try {
    return protocol::resolve(value);
  } catch (const std::runtime_error& error) {
    throw settings::UsageError(
        fmt::format("{} {}: {}; for example {}", option, value, error.what(), example));
  }
}

ToolSession::ToolSession(const ToolSettings& settings, const protocol::Endpoint& server,
                         std::uint64_t seed, Common common)
    : now_(std::move(common.now)),
      server_(server),
      link_(wire(settings, common.key), now_, seed),
      connection_(settings.server, common.key_file, common.connect_timeout, common.tool_may_change),
      status_(common.alone ? "" : settings.server) {}

protocol::DatagramLink& ToolSession::wire(const ToolSettings& settings,
                                          const std::optional<protocol::noise::Key>& key) {
  protocol::DatagramLink* link = &socket_;
  if (key) link = &sealed_.emplace(*link, server_, *key);
  if (settings.record.empty()) return *link;
  return recording_.emplace(settings.record, *link, socket_.local()).link;
}

void ToolSession::begin(HapticClientOptions options, const ToolAssembly& tool) {
  if (client_) client_->close(now_());
  options.server = server_;
  options.tool = tool.description;
  options.q = tool.q;
  client_.emplace(link_, options);
}

void ToolSession::report(const FrameResult& result, const VirtualTool& tool,
                         const Proximity& proximity) {
  connection_.watch(now_(), result.inbox, client_->connected());
  if (result.inbox.welcomed) warn_of_mismatch(tool.assembly(), client_->welcome().device);
  if (result.inbox.welcomed) scene_problem_.clear();
  if (client_->scene_problem() != scene_problem_) {
    scene_problem_ = client_->scene_problem();
    if (!scene_problem_.empty()) spdlog::warn("no shapes, but contacts: {}", scene_problem_);
  }
  status_.count(result);
  status_.report(now_(), *client_, proximity.statistics());
  if (recording_) recording_->link.drain(recording_->file);
}

void ToolSession::close() {
  link_.set_conditions({});
  client_->close(now_());
  if (recording_) recording_->link.drain(recording_->file);
}

}  // namespace hlm::ve
