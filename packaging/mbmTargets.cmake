# Defines mbm::mbm, the library with its headers; mbm::ports, the library with the ports over a
# tty, TCP and UDP, which are compiled with the program; and mbm::tls, both with the port inside
# TLS, which needs Mbed TLS. The two with ports are for Linux.
#
# mbmConfig.cmake sets these variables before:
#   _mbm_archive  the archive
#   _mbm_include, _mbm_ports, _mbm_tls  folders; the last two only on Linux
#   _mbm_global   GLOBAL, if other folders than the caller's shall see the targets
if(NOT TARGET mbm::mbm)
  add_library(mbm::mbm STATIC IMPORTED ${_mbm_global})
  set_target_properties(mbm::mbm PROPERTIES
    IMPORTED_LOCATION "${_mbm_archive}"
    INTERFACE_INCLUDE_DIRECTORIES "${_mbm_include}")
endif()

if(_mbm_ports AND NOT TARGET mbm::ports)
  add_library(mbm::ports INTERFACE IMPORTED ${_mbm_global})
  set(_mbm_sources mbm_tty.c mbm_tcp.c mbm_tcp_listener.c mbm_tcp_set.c mbm_call.c mbm_udp.c)
  list(TRANSFORM _mbm_sources PREPEND "${_mbm_ports}/")
  set_target_properties(mbm::ports PROPERTIES
    INTERFACE_SOURCES "${_mbm_sources}"
    INTERFACE_INCLUDE_DIRECTORIES "${_mbm_ports}"
    INTERFACE_LINK_LIBRARIES mbm::mbm)
endif()

if(_mbm_tls AND NOT TARGET mbm::tls)
  add_library(mbm::tls INTERFACE IMPORTED ${_mbm_global})
  set(_mbm_sources mbm_tls.c mbm_tls_identity.c mbm_tls_linux.c mbm_tls_listener.c mbm_tls_text.c)
  list(TRANSFORM _mbm_sources PREPEND "${_mbm_tls}/")
  set_target_properties(mbm::tls PROPERTIES
    INTERFACE_SOURCES "${_mbm_sources}"
    INTERFACE_INCLUDE_DIRECTORIES "${_mbm_tls}"
    INTERFACE_LINK_LIBRARIES "mbm::ports;mbedtls;mbedx509;mbedcrypto")
endif()
unset(_mbm_sources)
