#include "hlm/ve_client/scene/sdf_loader.h"

#include <algorithm>
#include <array>
#include <set>
#include <sstream>

#include <malloc.h>
#include <sdf/Root.hh>
#include <sdf/SDFImpl.hh>
#include <sdf/World.hh>

#include "hlm/common/range.h"
#include "hlm/ve_client/scene/sdf_elements.h"
#include "hlm/ve_client/scene/sdf_geometry.h"
#include "hlm/ve_client/scene/sdf_messages.h"
#include "hlm/ve_client/scene/sdf_models.h"
#include "hlm/ve_client/scene/sdf_places.h"
#include "hlm/ve_client/scene/sdf_trees.h"

namespace hlm::ve {
namespace {

/// A value of <physics>, if the file has it; path: the elements below <physics> down to it.
std::optional<double> physics_value(sdf::ElementPtr at, std::initializer_list<const char*> path,
                                    const Range& range, Diagnostics& diagnostics) {
  for (const char* name : path) {
    if (at) at = at->FindElement(name);
  }
  if (!at || !at->GetExplicitlySetInFile()) return std::nullopt;
  const auto value = at->Get<double>();
  if (const auto error = find_error("physics: " + at->GetName(), value, range)) {
    diagnostics.refuse(place_of(at), *error);
    return std::nullopt;
  }
  return value;
}

/// <physics>: of all that may stand there, the step and the solver's iterations.
SolverDescription read_solver(const sdf::ElementPtr& world, Diagnostics& diagnostics) {
  SolverDescription solver;
  const sdf::ElementPtr physics = world->FindElement("physics");
  solver.largest_step = physics_value(physics, {"max_step_size"}, {1e-4, 0.1, "s"}, diagnostics);
  const auto sweeps = physics_value(physics, {"ode", "solver", "iters"}, {1, 1000}, diagnostics);
  if (sweeps) solver.sweeps = static_cast<int>(*sweeps);
  return solver;
}

/// The text of a world's own element, with single spaces; empty if there is none.
std::string read_text(const sdf::ElementPtr& world, const std::string& name,
                      Diagnostics& diagnostics) {
  const sdf::ElementPtr element = world->FindElement(name);
  if (!element) return "";
  std::string text = single_spaced(element->Get<std::string>());
  if (text.empty()) diagnostics.refuse(place_of(element), tag(name) + " must not be empty");
  if (const sdf::ElementPtr second = element->GetNextElement(name)) {
    diagnostics.refuse(place_of(second),
                       tag(name) + " '" + text + "' must be the only one of the world");
  }
  return text;
}

/// Whether a check of ours says the same, or the error says nothing.
bool is_checked_before(const sdf::Error& error) {
  return error.Code() == sdf::ErrorCode::LINK_INERTIA_INVALID ||
         error.Code() == sdf::ErrorCode::ELEMENT_INVALID;
}

/// Whether the error only shows that there is another.
bool is_consequence(const sdf::Error& error) {
  return error.Code() == sdf::ErrorCode::POSE_RELATIVE_TO_GRAPH_ERROR ||
         error.Code() == sdf::ErrorCode::FRAME_ATTACHED_TO_GRAPH_ERROR ||
         error.Message().starts_with("FrameAttachedToGraph unable") ||
         error.Message().starts_with("PoseRelativeToGraph unable");
}

std::string in_words(const sdf::Error& error) {
  const std::string message = error.Message();
  if (error.Code() == sdf::ErrorCode::POSE_RELATIVE_TO_CYCLE ||
      error.Code() == sdf::ErrorCode::FRAME_ATTACHED_TO_CYCLE) {
    return "its frame depends on itself, by relative_to or attached_to";
  }
  const bool is_default = message.find("[__default__]") != message.npos;
  return is_default ? "must have a <parent> and a <child>" : message;
}

/// The element below `root` that a message of the parser means by "TYPE with name[NAME]" or "vertex
/// [NAME]"; null if it means none.
sdf::ElementPtr find_meant(const sdf::ElementPtr& root, const std::string& message) {
  for (sdf::ElementPtr child = root->GetFirstElement(); child; child = child->GetNextElement()) {
    if (sdf::ElementPtr inner = find_meant(child, message)) return inner;
    if (!child->GetAttributeSet("name")) continue;
    const std::string name = child->Get<std::string>("name");
    // Some messages begin with the type, as "Joint with …".
    const std::string type = child->GetName().substr(1);
    if (message.find(type + " with name[" + name + "]") != message.npos) return child;
    if (message.ends_with("vertex [" + name + "].")) return child;
  }
  return nullptr;
}

/// Reads one file.
class WorldReader {
 public:
  WorldReader(SdfFile& file, CapturedMessages& messages, Diagnostics& diagnostics)
      : file_(file), diagnostics_(diagnostics), trees_(file, messages, diagnostics) {}

  WorldDescription read() {
    const sdf::ElementPtr root = trees_.world();
    if (!root || !root->HasElement("world")) return {};
    bare_ = root;
    read_world(root->GetElement("world"));
    // Each model takes libsdformat some hundred kilobytes: one after the other is enough, unless
    // their poses depend on each other.
    std::vector<sdf::ElementPtr> group;
    for (int i = 0; i < trees_.model_count(); ++i) {
      if (const sdf::ElementPtr model = trees_.model(i)) group.push_back(model);
      if (trees_.connected()) continue;
      add_models(group);
      group.clear();
    }
    add_models(group);
    check_tools();
    return std::move(world_);
  }

 private:
  void read_world(const sdf::ElementPtr& element) {
    world_.gravity_W = to_vector(element->Get<ignition::math::Vector3d>("gravity"));
    world_.solver = read_solver(element, diagnostics_);
    read_tool(element, "haptic:tool", 0);
    read_tool(element, "haptic:second_tool", 1);
    world_.description = read_text(element, "haptic:description", diagnostics_);
    // Nothing depends on the world's name, but some are reserved. <physics> has been read, and
    // libsdformat's World wants what the schema leaves out of it.
    element->GetAttribute("name")->SetFromString("default");
    while (const sdf::ElementPtr physics = element->FindElement("physics")) {
      element->RemoveChild(physics);
    }
  }

  void read_tool(const sdf::ElementPtr& element, const char* name, std::size_t tool) {
    world_.tools[tool] = read_text(element, name, diagnostics_);
    if (!world_.tools[tool].empty()) tool_places_[tool] = place_of(element->FindElement(name));
  }

  void add_models(const std::vector<sdf::ElementPtr>& models) {
    if (models.empty()) return;
    const auto sdf = std::make_shared<sdf::SDF>();
    sdf->Root(bare_->Clone());
    const sdf::ElementPtr world = sdf->Root()->GetElement("world");
    for (const sdf::ElementPtr& model : models) {
      require_own_name(model);
      model->SetParent(world);
      world->InsertElement(model);
    }
    sdf::Root root;
    const bool alone = !trees_.connected();
    report(root.Load(sdf, parser_config()), world,
           alone ? place_of(models.front()) : Place{file_.name, 0, ""});
    const sdf::World* source = root.WorldByIndex(0);
    for (std::uint64_t i = 0; source != nullptr && i < source->ModelCount(); ++i) {
      add_model(*source->ModelByIndex(i), world_, diagnostics_);
    }
  }

  void require_own_name(const sdf::ElementPtr& model) {
    const auto name = model->Get<std::string>("name");
    if (names_.insert(name).second) return;
    diagnostics_.refuse(place_of(model),
                        "a second model of this name; give the <include> a <name>, "
                        "or rename one");
  }

  /// What the parser finds wrong between elements: names and frames. Of what follows from that it
  /// has more to say.
  void report(const sdf::Errors& errors, const sdf::ElementPtr& world, const Place& otherwise) {
    const int refused = diagnostics_.count(Verdict::kRefused);
    std::set<std::string> places;
    for (const bool consequences : {false, true}) {
      if (consequences && diagnostics_.count(Verdict::kRefused) > refused) return;
      for (const sdf::Error& error : errors) {
        if (is_checked_before(error) || is_consequence(error) != consequences) continue;
        const sdf::ElementPtr meant = find_meant(world, error.Message());
        const Place place = meant ? place_of(meant) : otherwise;
        if (meant && !places.insert(to_string(place)).second) continue;
        diagnostics_.refuse(place, in_words(error));
      }
    }
  }

  void check_tools() {
    for (std::size_t i = 0; i < world_.tools.size(); ++i) {
      if (world_.tools[i].empty()) continue;
      try {
        find_model(world_, world_.tools[i]);
      } catch (const std::runtime_error& error) {
        diagnostics_.refuse(tool_places_[i], error.what());
      }
    }
  }

  SdfFile& file_;
  Diagnostics& diagnostics_;
  SdfTrees trees_;
  sdf::ElementPtr bare_;  ///< <sdf> with the world, without models.
  WorldDescription world_;
  std::array<Place, kMostTools> tool_places_;
  std::set<std::string> names_;
};

/// `open(diagnostics)`: the file.
template <class Open>
WorldDescription read_with(Open open, Diagnostics& diagnostics) {
  WorldDescription world;
  {
    CapturedMessages messages;
    if (const std::shared_ptr<SdfFile> file = open(diagnostics)) {
      world = WorldReader(*file, messages, diagnostics).read();
    }
  }
  malloc_trim(0);  // What the parser has used goes back to the system.
  return world;
}

WorldDescription usable(WorldDescription world, Diagnostics diagnostics) {
  if (!diagnostics.usable()) throw RefusedWorld(std::move(diagnostics));
  return world;
}

}  // namespace

std::string single_spaced(const std::string& text) {
  std::istringstream words(text);
  std::string line;
  for (std::string word; words >> word;) line.append(line.empty() ? "" : " ").append(word);
  return line;
}

WorldDescription load_world(const std::filesystem::path& file, Diagnostics& diagnostics) {
  return read_with([&](Diagnostics& sink) { return read_file(file, sink); }, diagnostics);
}

WorldDescription load_world(const std::filesystem::path& file) {
  Diagnostics diagnostics;
  WorldDescription world = load_world(file, diagnostics);
  return usable(std::move(world), std::move(diagnostics));
}

WorldDescription parse_world(const std::string& text, const std::string& name,
                             Diagnostics& diagnostics) {
  return read_with([&](Diagnostics& sink) { return parse_file(text, name, sink); }, diagnostics);
}

WorldDescription parse_world(const std::string& text, const std::string& name) {
  Diagnostics diagnostics;
  WorldDescription world = parse_world(text, name, diagnostics);
  return usable(std::move(world), std::move(diagnostics));
}

}  // namespace hlm::ve
