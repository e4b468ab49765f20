#include "hlm/scene/mesh_file.h"

#include <array>
#include <stdexcept>
#include <utility>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "hlm/common/one_line.h"

namespace hlm::ve {
namespace {

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw std::runtime_error(one_line("mesh " + name + ": " + what));
}

/// Adds the triangles of a node and its children.
void collect(const aiScene& scene, const aiNode& node, const aiMatrix4x4& parent,
             const std::string& submesh, Mesh& mesh) {
  const aiMatrix4x4 X = parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& part = *scene.mMeshes[node.mMeshes[i]];
    const bool chosen =
        submesh.empty() || submesh == part.mName.C_Str() || submesh == node.mName.C_Str();
    if (!chosen) continue;
    const auto first = static_cast<int>(mesh.points.size());
    for (unsigned p = 0; p < part.mNumVertices; ++p) {
      const aiVector3D point = X * part.mVertices[p];
      mesh.points.emplace_back(point.x, point.y, point.z);
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;
      std::array<int, 3>& triangle = mesh.triangles.emplace_back();
      for (unsigned c = 0; c < 3; ++c) {
        if (face.mIndices[c] >= part.mNumVertices) {
          throw std::runtime_error("a triangle has a corner " + std::to_string(face.mIndices[c]) +
                                   " of " + std::to_string(part.mNumVertices) + " points");
        }
        triangle[c] = first + static_cast<int>(face.mIndices[c]);
      }
    }
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i) {
    collect(scene, *node.mChildren[i], X, submesh, mesh);
  }
}

}  // namespace

Mesh read_mesh(const MeshSource& source, std::vector<std::string>& repairs) {
  const std::string name = source.file.string();
  Assimp::Importer importer;
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* scene = importer.ReadFile(
      name, aiProcess_ValidateDataStructure | aiProcess_Triangulate | aiProcess_SortByPType);
  if (scene == nullptr || scene->mRootNode == nullptr) fail(name, importer.GetErrorString());
  Mesh mesh;
  try {
    collect(*scene, *scene->mRootNode, aiMatrix4x4(), source.submesh, mesh);
  } catch (const std::runtime_error& error) {
    fail(name, error.what());
  }
  if (mesh.triangles.empty() && !source.submesh.empty()) {
    fail(name, "has no submesh '" + source.submesh + "' with triangles");
  }
  Eigen::AlignedBox3d box;
  for (Vector3& p : mesh.points) box.extend(p = p.cwiseProduct(source.scale));
  if (source.center && !mesh.points.empty()) {
    for (Vector3& p : mesh.points) p -= box.center();
  }
  const bool mirrored = source.scale.prod() < 0;
  if (mirrored) {
    for (std::array<int, 3>& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  }
  return repaired(std::move(mesh), name, repairs);
}

}  // namespace hlm::ve
