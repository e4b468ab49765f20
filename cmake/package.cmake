# The Debian package that scripts/package makes.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME haptic-local-model)
set(CPACK_PACKAGE_CONTACT "The haptic local model authors <haptic@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "six-DOF haptics between a physics engine and a force-feedback device")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
  "A server that runs the local model of interaction and the control of a haptic
device at a fixed rate, a virtual environment that sends it contacts over UDP,
and the client library for other engines, in C++, C and Python.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "python3, python3-numpy")
# What hlm::client is compiled with.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libeigen3-dev, libboost-dev")
# What shows the live page, which a server in a cellar need not.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "firefox-esr | chromium | www-browser, xdg-utils, wireshark")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(debian ${PROJECT_SOURCE_DIR}/packaging/debian)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${debian}/postinst ${debian}/prerm ${debian}/postrm ${debian}/triggers)
include(CPack)

# scripts/package has built it.
install(DIRECTORY out/site/ DESTINATION ${documents}/html)
install(FILES CITATION.cff README.md DESTINATION ${documents})

configure_file(packaging/debian/changelog.in changelog.Debian @ONLY)
find_program(GZIP gzip REQUIRED)
execute_process(COMMAND ${GZIP} -9nf changelog.Debian WORKING_DIRECTORY ${PROJECT_BINARY_DIR})
install(FILES ${debian}/copyright ${PROJECT_BINARY_DIR}/changelog.Debian.gz DESTINATION ${documents})
install(FILES ${debian}/lintian-overrides DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides
  RENAME haptic-local-model)
