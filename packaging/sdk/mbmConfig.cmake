# Chooses the archive for a target; mbmTargets.cmake says which CMake targets there are.
#
#   MBM_TARGET   a folder of lib/, for example cortex-m4. If it is not set, the compiler's macros
#                decide. "assembler" compiles the library from asm/ instead of an archive; the
#                project needs the language ASM.
#
# The result is mbm_TARGET; mbm_TARGETS lists all targets, and mbm_ROOT_DIR is the folder of the SDK.
get_filename_component(mbm_ROOT_DIR "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
file(GLOB mbm_TARGETS RELATIVE "${mbm_ROOT_DIR}/lib" "${mbm_ROOT_DIR}/lib/*/libmbm.a")
list(TRANSFORM mbm_TARGETS REPLACE "/libmbm.a$" "")
set(_mbm_fault)

# The language whose compiler and options say what the target is.
set(_mbm_language C)
set(_mbm_kind c)
if(NOT CMAKE_C_COMPILER)
  set(_mbm_language CXX)
  set(_mbm_kind c++)
endif()
separate_arguments(_mbm_flags NATIVE_COMMAND "${CMAKE_${_mbm_language}_FLAGS}")

# Sets _mbm_guess to the target of the compiler, or _mbm_fault.
macro(_mbm_probe)
  # The options that all files of the caller's folder are compiled with.
  get_directory_property(_mbm_options COMPILE_OPTIONS)
  list(FILTER _mbm_options EXCLUDE REGEX "\\$<")
  if(CMAKE_${_mbm_language}_COMPILER_TARGET)
    list(APPEND _mbm_options
      "${CMAKE_${_mbm_language}_COMPILE_OPTIONS_TARGET}${CMAKE_${_mbm_language}_COMPILER_TARGET}")
  endif()
  execute_process(
    COMMAND ${CMAKE_${_mbm_language}_COMPILER} ${CMAKE_${_mbm_language}_COMPILER_ARG1} ${_mbm_flags} ${_mbm_options}
            -E -P -x ${_mbm_kind} "${mbm_ROOT_DIR}/lib/target.h"
    OUTPUT_VARIABLE _mbm_output ERROR_VARIABLE _mbm_output_error RESULT_VARIABLE _mbm_code)
  if(_mbm_code EQUAL 0 AND _mbm_output MATCHES "MBM_TARGET \"([^\"]+)\"")
    set(_mbm_guess "${CMAKE_MATCH_1}")
  elseif(NOT CMAKE_${_mbm_language}_COMPILER)
    set(_mbm_fault "mbm cannot guess the target without a compiler: call project() before, or set MBM_TARGET.")
  else()
    set(_mbm_fault "mbm cannot guess the target, because the compiler fails: ${_mbm_output_error}")
  endif()
endmacro()

set(mbm_TARGET "${MBM_TARGET}")
if(mbm_TARGET STREQUAL "")
  _mbm_probe()
  if(NOT _mbm_fault)
    set(mbm_TARGET "${_mbm_guess}")
    if(mbm_TARGET STREQUAL "unknown")
      string(JOIN " " _mbm_seen ${_mbm_flags} ${_mbm_options})
      set(_mbm_fault "mbm has no library for the target of this compiler with its options, \"${_mbm_seen}\". Options of a \
single CMake target are not seen: name the processor in CMAKE_${_mbm_language}_FLAGS, or in add_compile_options before \
find_package.")
    endif()
  endif()
endif()

if(mbm_FIND_COMPONENTS)
  set(_mbm_fault "mbm has no components.")
endif()

if(NOT _mbm_fault)
  if(mbm_TARGET STREQUAL "assembler")
    if(NOT CMAKE_ASM_COMPILER)
      set(_mbm_fault "For this target mbm is compiled from assembler source: add ASM to the languages of project().")
    endif()
  elseif(NOT mbm_TARGET IN_LIST mbm_TARGETS)
    set(_mbm_fault "mbm has no library for the target ${mbm_TARGET}.")
  endif()
endif()

if(_mbm_fault)
  set(mbm_FOUND FALSE)
  string(REPLACE ";" ", " _mbm_known "${mbm_TARGETS}")
  set(mbm_NOT_FOUND_MESSAGE "${_mbm_fault}\nMBM_TARGET can be one of: ${_mbm_known}, assembler.")
else()
  set(_mbm_archive "${mbm_ROOT_DIR}/lib/${mbm_TARGET}/libmbm.a")
  set(_mbm_include "${mbm_ROOT_DIR}/include")
  if(mbm_TARGET STREQUAL "assembler" AND NOT TARGET mbm::mbm)
    file(GLOB _mbm_sources "${mbm_ROOT_DIR}/asm/*.S")
    add_library(mbm_assembler STATIC EXCLUDE_FROM_ALL ${_mbm_sources})
    target_include_directories(mbm_assembler PUBLIC "${_mbm_include}")
    # A #if in each file asks for the processor, which toolchain files often give only to C.
    target_compile_options(mbm_assembler PRIVATE ${_mbm_flags})
    add_library(mbm::mbm ALIAS mbm_assembler)
  endif()
  include("${CMAKE_CURRENT_LIST_DIR}/mbmTargets.cmake")
endif()
