# find_package(haptic_local_model) gives hlm::client, the client library.
include(CMakeFindDependencyMacro)
find_dependency(Boost 1.74)
find_dependency(Eigen3 3.4 NO_MODULE)
find_dependency(Threads)
include(${CMAKE_CURRENT_LIST_DIR}/haptic_local_modelTargets.cmake)
