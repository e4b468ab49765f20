# What the programs read: the live page with its modules, the worlds, the dissector.
function(hlm_install_shared_files share)
  install(DIRECTORY worlds scripts/wireshark DESTINATION ${share})
  if(NOT TARGET haptic_page)
    return()
  endif()
  set(page ${PROJECT_SOURCE_DIR}/page/front)
  install(CODE "
    if(NOT EXISTS \"${page}/node_modules/three\" OR NOT EXISTS \"${page}/node_modules/uplot\")
      message(FATAL_ERROR \"${page}/node_modules lacks three or uplot: run scripts/setup run\")
    endif()")
  install(DIRECTORY page/front/ DESTINATION ${share}/page FILES_MATCHING
    PATTERN "node_modules" EXCLUDE
    PATTERN "*.html" PATTERN "*.css" PATTERN "*.js")
  set(modules ${share}/page/node_modules)
  install(FILES ${page}/node_modules/three/LICENSE DESTINATION ${modules}/three)
  install(FILES ${page}/node_modules/uplot/LICENSE DESTINATION ${modules}/uplot)
  install(FILES
    ${page}/node_modules/three/build/three.core.js
    ${page}/node_modules/three/build/three.module.js
    DESTINATION ${modules}/three/build)
  install(DIRECTORY ${page}/node_modules/three/examples/jsm/controls
    DESTINATION ${modules}/three/examples/jsm)
  install(FILES
    ${page}/node_modules/uplot/dist/uPlot.esm.js
    ${page}/node_modules/uplot/dist/uPlot.min.css
    DESTINATION ${modules}/uplot/dist)
endfunction()
