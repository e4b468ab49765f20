// Conversion of the XML of a world to libsdformat's elements, as its latest version has them: files
// included and models within models read one by one, values checked, what is not used reported.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sdf/Element.hh>
#include <sdf/ParserConfig.hh>
#include <sdf/Types.hh>

#include "hlm/ve_client/scene/sdf_file.h"
#include "hlm/ve_client/scene/sdf_messages.h"

namespace hlm::ve {

class SdfTrees {
 public:
  /// Trees of a file with one world or one model. All arguments must outlive this; `messages` are
  /// the parser's.
  SdfTrees(SdfFile& file, CapturedMessages& messages, Diagnostics& diagnostics);

  /// <sdf> with the <world>, without its models. For a file without a world an empty one.
  sdf::ElementPtr world();

  /// The models at the top, written out or included.
  int model_count() const { return static_cast<int>(models_.size()); }
  /// <model> with those within it; null if it cannot be read.
  sdf::ElementPtr model(int index);

  /// Whether poses at the top depend on each other: there are frames, or poses relative to one.
  bool connected() const { return connected_; }

 private:
  sdf::ElementPtr read_model(tinyxml2::XMLElement& model, SdfFile& file, const std::string& scope);
  sdf::ElementPtr read_include(const tinyxml2::XMLElement& include, const SdfFile& file,
                               const std::string& scope);
  /// A model that stands in the file, or the one that an <include> brings in.
  sdf::ElementPtr read_either(tinyxml2::XMLElement& element, SdfFile& file,
                              const std::string& scope);
  sdf::ElementPtr parse(const tinyxml2::XMLElement& element, const SdfFile& file,
                        const std::string& scope);
  void report(const sdf::Errors& errors, const SdfFile& file, const std::string& scope);
  /// An attribute that is not read, which may hold a value that belongs into an element.
  void report_attribute(const sdf::Error& error, const SdfFile& file, const std::string& scope);

  SdfFile& file_;
  CapturedMessages& messages_;
  Diagnostics& diagnostics_;
  tinyxml2::XMLElement* world_ = nullptr;
  std::vector<tinyxml2::XMLElement*> models_;
  bool connected_ = false;
  int read_ = 0;  ///< Models so far.
};

/// How libsdformat reads: what is not in the schema is an error of its own, with its line.
sdf::ParserConfig parser_config();

}  // namespace hlm::ve
