#include "hlm/ve_client/scene/mesh_file.h"

#include <array>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "hlm/common/one_line.h"
#include "hlm/ve_client/scene/in_child.h"

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

/// Reads the triangles alone. What else is there, as cameras and lights, is dropped before the
/// check: two of them with one name are no error here.
const aiScene* read_scene(Assimp::Importer& importer, const std::string& name) {
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS |
                                  aiComponent_COLORS | aiComponent_TEXCOORDS |
                                  aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                  aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS);
  if (importer.ReadFile(name, aiProcess_RemoveComponent) == nullptr) return nullptr;
  return importer.ApplyPostProcessing(aiProcess_ValidateDataStructure | aiProcess_Triangulate |
                                      aiProcess_SortByPType);
}

/// What is chosen of a file, as it is there. Throws std::runtime_error.
Mesh read_triangles(const MeshSource& source) {
  Assimp::Importer importer;
  const aiScene* scene = read_scene(importer, source.file.string());
  if (scene == nullptr || scene->mRootNode == nullptr) {
    throw std::runtime_error(importer.GetErrorString());
  }
  Mesh mesh;
  collect(*scene, *scene->mRootNode, aiMatrix4x4(), source.submesh, mesh);
  return mesh;
}

template <class T>
void append(std::string& bytes, const std::vector<T>& items) {
  const std::size_t count = items.size();
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  bytes.append(reinterpret_cast<const char*>(items.data()), count * sizeof(T));
}

/// Takes what append() has added from the front.
template <class T>
std::vector<T> take(std::string_view& bytes) {
  std::size_t count = 0;
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes.remove_prefix(sizeof count);
  std::vector<T> items(count);
  if (count > 0) std::memcpy(static_cast<void*>(items.data()), bytes.data(), count * sizeof(T));
  bytes.remove_prefix(count * sizeof(T));
  return items;
}

/// The same, where assimp cannot crash this process.
Mesh read_safely(const MeshSource& source) {
  const std::string bytes = made_in_child([&] {
    const Mesh mesh = read_triangles(source);
    std::string text;
    append(text, mesh.points);
    append(text, mesh.triangles);
    return text;
  });
  std::string_view rest = bytes;
  Mesh mesh;
  mesh.points = take<Vector3>(rest);
  mesh.triangles = take<std::array<int, 3>>(rest);
  return mesh;
}

}  // namespace

Mesh read_mesh(const MeshSource& source, std::vector<std::string>& repairs) {
  const std::string name = source.file.string();
  Mesh mesh;
  try {
    mesh = read_safely(source);
  } catch (const std::exception& error) {
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
