# A module's headers are reached as "hlm/MODULE/…" by those who link its library, and by nobody else:
# the build tree has a folder for each module with a link to where its files are.

# hlm_headers(LIBRARY MODULE [PUBLIC_HEADER …]): what is named is installed below include/hlm/MODULE.
function(hlm_headers library module)
  set(root ${PROJECT_BINARY_DIR}/include/${module})
  file(MAKE_DIRECTORY ${root}/hlm)
  file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR} ${root}/hlm/${module} SYMBOLIC)
  if(ARGN)
    list(TRANSFORM ARGN PREPEND ${root}/hlm/${module}/ OUTPUT_VARIABLE headers)
    target_sources(${library} PUBLIC FILE_SET HEADERS BASE_DIRS ${root} FILES ${headers})
  else()
    target_include_directories(${library} PUBLIC $<BUILD_INTERFACE:${root}>)
  endif()
  quick_build(${library})
endfunction()
