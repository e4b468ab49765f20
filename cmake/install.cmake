# What `cmake --install` puts where.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
include(cmake/shared_files.cmake)
set(headers ${CMAKE_INSTALL_INCLUDEDIR}/haptic_local_model)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/haptic_local_model)
set(share ${CMAKE_INSTALL_DATADIR}/haptic_local_model)
set(documents ${CMAKE_INSTALL_DOCDIR})

# The client library, for find_package(haptic_local_model): hlm::client, and with sealing hlm::sealing
# and hlm::haptic, the C interface, with its Python package.
set(libraries common protocol udp client)
if(HLM_SEALING)
  list(APPEND libraries sealing)
endif()
foreach(library ${libraries})
  set_target_properties(hlm_${library} PROPERTIES EXPORT_NAME ${library})
  install(TARGETS hlm_${library} EXPORT haptic_local_model FILE_SET HEADERS DESTINATION ${headers})
endforeach()
if(HLM_SEALING)
  set_target_properties(hlm_haptic PROPERTIES EXPORT_NAME haptic)
  install(TARGETS hlm_haptic EXPORT haptic_local_model FILE_SET HEADERS
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  if(HLM_SERVER)
    set_target_properties(hlm_haptic_virtual PROPERTIES EXPORT_NAME haptic_virtual)
    install(TARGETS hlm_haptic_virtual EXPORT haptic_local_model FILE_SET HEADERS
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  endif()
  file(RELATIVE_PATH from_pkgconfig /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
  # Where the system looks for no libraries, what is linked knows where they are.
  set(rpath "-Wl,-rpath,\${libdir} ")
  if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
    set(rpath "")
  endif()
  configure_file(cmake/haptic.pc.in haptic.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/haptic.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
  install(DIRECTORY client/python/haptic client/python/haptic_local_model DESTINATION lib/python3/dist-packages
    FILES_MATCHING PATTERN "*.py" PATTERN "py.typed")
endif()
install(EXPORT haptic_local_model NAMESPACE hlm:: FILE haptic_local_modelTargets.cmake
  DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/haptic_local_modelConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES cmake/haptic_local_modelConfig.cmake
  ${PROJECT_BINARY_DIR}/haptic_local_modelConfigVersion.cmake DESTINATION ${package})

# A unit for systemd, in its own folder below the prefix: it reads those of /usr and /usr/local.
file(READ packaging/sandbox.conf HLM_SANDBOX)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS packaging/sandbox.conf)
function(install_unit unit)
  configure_file(packaging/${unit}.in ${unit} @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${unit} DESTINATION lib/systemd/system)
endfunction()

# The programs, and what they read.
if(HLM_SERVER OR HLM_VE_CLIENT)
  install(TARGETS haptic_keygen)
endif()
if(HLM_SERVER)
  install(TARGETS haptic_doctor haptic_replay haptic_server)
  install_unit(haptic_server.service)
  install_unit(haptic_server@.service)
  install(FILES packaging/haptic_server.sysusers DESTINATION lib/sysusers.d
    RENAME haptic_server.conf)
  install(FILES packaging/60-haptic_server.rules DESTINATION lib/udev/rules.d)
endif()
if(TARGET haptic_page)
  install(TARGETS haptic_page)
endif()
if(HLM_VE_CLIENT)
  install(TARGETS ve_client)
  install_unit(ve_client@.service)
endif()
hlm_install_shared_files(${share})
if(HLM_SERVER AND HLM_VE_CLIENT)
  install(PROGRAMS packaging/haptic_demo DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(FILES packaging/haptic_demo.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
  install(FILES packaging/haptic_demo.svg DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps)
endif()

# bash-completion asks the programs for their options.
foreach(program haptic_doctor haptic_keygen haptic_replay haptic_server ve_client)
  file(CONFIGURE OUTPUT completions/${program} CONTENT "_${program}() {
  local options
  options=\$(${program} --help-all 2>/dev/null || ${program} --help)
  mapfile -t COMPREPLY < <(compgen -W \"\$(grep -oE -- '--[a-z-]+' <<<\"\$options\" | sort -u)\" -- \"\$2\")
}
complete -o default -F _${program} ${program}\n")
  install(FILES ${PROJECT_BINARY_DIR}/completions/${program}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
endforeach()

# Manual pages, from the programs' own --help.
find_program(HELP2MAN help2man)
function(manual_page program purpose file)
  if(NOT HELP2MAN OR HLM_SANITIZE)
    return()
  endif()
  set(page ${PROJECT_BINARY_DIR}/man/${program}.1)
  set(help --help-all)
  if(program MATCHES "keygen|page|demo")
    set(help --help)
  endif()
  add_custom_command(OUTPUT ${page}.gz
    COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/man
    COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${PROJECT_SOURCE_DIR}/client/python
      ${HELP2MAN} --no-info --locale C.UTF-8 --name ${purpose} --output ${page} --help-option ${help} ${file}
    COMMAND gzip -9nf ${page}
    DEPENDS ${file} VERBATIM)
  add_custom_target(${program}_man ALL DEPENDS ${page}.gz)
  install(FILES ${page}.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  if(TARGET optimised_tests)
    add_dependencies(optimised_tests ${program}_man)
  endif()
endfunction()
foreach(each
  "haptic_keygen|makes the key that haptic server and client share"
  "haptic_page|serves the live page of a session of another program"
  "haptic_server|runs the local model of interaction with a haptic device"
  "haptic_doctor|finds out why no force is felt"
  "haptic_replay|plays a recorded session of the haptic server"
  "ve_client|simulates a virtual environment for the haptic server")
  string(REPLACE "|" ";" each "${each}")
  list(GET each 0 program)
  list(GET each 1 purpose)
  if(TARGET ${program})
    manual_page(${program} ${purpose} $<TARGET_FILE:${program}>)
  endif()
endforeach()
if(HLM_SERVER AND HLM_VE_CLIENT)
  manual_page(haptic_demo "shows in a browser what the local model does" ${PROJECT_SOURCE_DIR}/packaging/haptic_demo)
endif()

install(DIRECTORY examples DESTINATION ${documents} PATTERN __pycache__ EXCLUDE PATTERN node_modules EXCLUDE
  PATTERN .npmrc EXCLUDE)
if(NOT HLM_PACKAGE)  # Packages have the site.
  install(FILES README.md CHANGELOG.md CITATION.cff CONTRIBUTING.md LICENSE DESTINATION ${documents})
  install(FILES protocol/PROTOCOL.md DESTINATION ${documents}/protocol)
  install(DIRECTORY docs DESTINATION ${documents} PATTERN site EXCLUDE)
endif()
