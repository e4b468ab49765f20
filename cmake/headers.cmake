# A header is included by its path in the tree, after "hlm/": cmake/include/hlm has a link to each room of
# the product; those of tests and experiments are included by their path alone.

# hlm_headers(LIBRARY [PUBLIC_HEADER …]): what is named is installed.
function(hlm_headers library)
  set(root ${PROJECT_SOURCE_DIR}/cmake/include)
  if(ARGN)
    file(RELATIVE_PATH here ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
    list(TRANSFORM ARGN PREPEND ${root}/hlm/${here}/ OUTPUT_VARIABLE headers)
    target_sources(${library} PUBLIC FILE_SET HEADERS BASE_DIRS ${root} FILES ${headers})
  else()
    target_include_directories(${library} PUBLIC $<BUILD_INTERFACE:${root}>)
  endif()
  quick_build(${library})
endfunction()
