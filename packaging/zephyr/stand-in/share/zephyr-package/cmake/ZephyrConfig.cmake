# Plays Zephyr's build for an application: configure.py reads module, options and devicetree, the
# module is added, and application, module, board.c and the module's line in memory are linked.
# STAND_IN_MODULE is the module's folder, STAND_IN_CORE cortex-m or riscv, STAND_IN_UART_KIND what
# the UART's driver can do: see board.c.
get_filename_component(STAND_IN ${CMAKE_CURRENT_LIST_DIR}/../../.. ABSOLUTE)
project(Zephyr-Kernel C ASM)
set(STAND_IN_OUT ${CMAKE_BINARY_DIR}/generated)
execute_process(
    COMMAND ${STAND_IN_PYTHON} ${STAND_IN}/configure.py ${STAND_IN} ${STAND_IN_MODULE}
            ${CMAKE_SOURCE_DIR} ${STAND_IN_CORE} ${STAND_IN_OUT}
    RESULT_VARIABLE failed)
if(failed)
    message(FATAL_ERROR "configure.py fails")
endif()
include(${STAND_IN_OUT}/options.cmake)

# All of Zephyr's code sees these.
add_library(zephyr_interface INTERFACE)
target_include_directories(zephyr_interface INTERFACE ${STAND_IN}/include ${STAND_IN_OUT})
target_compile_options(zephyr_interface INTERFACE -imacros ${STAND_IN_OUT}/autoconf.h
    $<$<COMPILE_LANGUAGE:C>:-Wall;-Wextra;-Werror> -Wa,--fatal-warnings)

function(zephyr_include_directories)
    foreach(folder IN LISTS ARGN)
        get_filename_component(folder ${folder} ABSOLUTE)
        target_include_directories(zephyr_interface INTERFACE ${folder})
    endforeach()
endfunction()

macro(zephyr_library_named name)
    set(ZEPHYR_CURRENT_LIBRARY ${name})
    add_library(${name} STATIC)
    target_link_libraries(${name} PUBLIC zephyr_interface)
endmacro()

function(zephyr_library_sources)
    target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()

function(zephyr_library_sources_ifdef option)
    if(${option})
        zephyr_library_sources(${ARGN})
    endif()
endfunction()

add_subdirectory(${STAND_IN_MODULE}/zephyr mbm)

add_library(app STATIC)
target_link_libraries(app PUBLIC zephyr_interface)
add_executable(zephyr.elf ${STAND_IN}/board.c ${STAND_IN_MODULE}/tests/line.c
    ${STAND_IN_MODULE}/tests/late.c)
target_compile_definitions(zephyr.elf PRIVATE STAND_IN_UART_KIND=${STAND_IN_UART_KIND})
target_include_directories(zephyr.elf PRIVATE ${STAND_IN_MODULE}/tests)
target_link_libraries(zephyr.elf PRIVATE zephyr_interface -Wl,--start-group app mbm -Wl,--end-group)
