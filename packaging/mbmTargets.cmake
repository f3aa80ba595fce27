# Defines mbm::mbm, the library with its headers; on Linux it has the ports over a tty, TCP and UDP too.
# There mbm::tls is the library with the port inside TLS, which needs Mbed TLS, and mbm::shared is the shared library
# where that is installed, as by a Debian package.
#
# mbmConfig.cmake sets these variables before:
#   _mbm_archive  the archive
#   _mbm_include  the folder of the headers
#   _mbm_global   GLOBAL, if other folders than the caller's shall see the targets
if(NOT TARGET mbm::mbm)
  add_library(mbm::mbm STATIC IMPORTED ${_mbm_global})
  set_target_properties(mbm::mbm PROPERTIES
    IMPORTED_LOCATION "${_mbm_archive}"
    INTERFACE_INCLUDE_DIRECTORIES "${_mbm_include}")
endif()

string(REPLACE "/libmbm.a" "/libmbm-tls.a" _mbm_tls "${_mbm_archive}")
if(EXISTS "${_mbm_tls}" AND NOT TARGET mbm::tls)
  add_library(mbm::tls STATIC IMPORTED ${_mbm_global})
  set_target_properties(mbm::tls PROPERTIES
    IMPORTED_LOCATION "${_mbm_tls}"
    INTERFACE_LINK_LIBRARIES "mbm::mbm;mbedtls;mbedx509;mbedcrypto")
endif()
unset(_mbm_tls)

string(REPLACE "/libmbm.a" "/libmbm.so" _mbm_shared "${_mbm_archive}")
if(EXISTS "${_mbm_shared}" AND NOT TARGET mbm::shared)
  add_library(mbm::shared SHARED IMPORTED ${_mbm_global})
  set_target_properties(mbm::shared PROPERTIES
    IMPORTED_LOCATION "${_mbm_shared}"
    INTERFACE_INCLUDE_DIRECTORIES "${_mbm_include}")
endif()
unset(_mbm_shared)
