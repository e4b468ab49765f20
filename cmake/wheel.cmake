# What a wheel holds besides the Python package, for scikit-build-core: below haptic_local_model/, so that programs,
# libraries and what they read find one another by their places.
include(cmake/shared_files.cmake)
set(programs haptic_doctor haptic_keygen haptic_page haptic_replay haptic_server)
if(HLM_VE_CLIENT)
  list(APPEND programs ve_client)
endif()
install(TARGETS ${programs} RUNTIME DESTINATION haptic_local_model/bin)
# Wheels have no symbolic links: the file itself has the name that is looked for.
get_target_property(abi hlm_haptic SOVERSION)
set_target_properties(hlm_haptic hlm_haptic_virtual PROPERTIES VERSION ${abi})
install(TARGETS hlm_haptic hlm_haptic_virtual LIBRARY DESTINATION haptic_local_model/lib NAMELINK_SKIP)
install(FILES client/haptic.h tools/virtual/haptic_virtual.h DESTINATION haptic_local_model/include)
hlm_install_shared_files(haptic_local_model/share/haptic_local_model)
