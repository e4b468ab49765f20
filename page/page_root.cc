#include "hlm/page/page_root.h"

namespace hlm::ve {

std::filesystem::path page_beside_program() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / HLM_PAGE;
}

}  // namespace hlm::ve
