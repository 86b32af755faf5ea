# Configures, builds and runs the consumer in the given MODE, then looks at what icat did to it.
# The parameters are those that tests/CMakeLists.txt passes.
cmake_minimum_required(VERSION 3.22)

# What the user's project gets must come from icat alone.
foreach(variable CXXFLAGS LDFLAGS CMAKE_BUILD_TYPE)
  unset(ENV{${variable}})
endforeach()

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "consumer (${MODE}): failed (${result}): ${ARGV}")
  endif()
endfunction()

file(REMOVE_RECURSE "${WORK_DIR}")
set(prefix "${WORK_DIR}/prefix")
set(build "${WORK_DIR}/build")

if(MODE MATCHES "package")
  run("${CMAKE_COMMAND}" --install "${ICAT_BINARY_DIR}" --prefix "${prefix}")
  file(GLOB_RECURSE package_files "${prefix}/*.cmake")
  foreach(file IN LISTS package_files)
    file(READ "${file}" text)
    string(FIND "${text}" "${ICAT_SOURCE_DIR}" position)
    if(NOT position EQUAL -1)
      message(FATAL_ERROR "consumer: ${file} names the source tree")
    endif()
  endforeach()
endif()
if(MODE STREQUAL "relocated_package")
  file(RENAME "${prefix}" "${WORK_DIR}/moved prefix")
  set(prefix "${WORK_DIR}/moved prefix")
endif()

run("${CMAKE_COMMAND}" -S "${CMAKE_CURRENT_LIST_DIR}" -B "${build}" -G "${CMAKE_GENERATOR}"
  "-DMODE=${MODE}"
  "-DICAT_SOURCE_DIR=${ICAT_SOURCE_DIR}"
  "-DICAT_VERSION=${ICAT_VERSION}"
  "-DCMAKE_PREFIX_PATH=${prefix}"
  "-DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER}"
  "-DCMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}"
  "-DEigen3_DIR=${Eigen3_DIR}"
  "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")
run("${CMAKE_COMMAND}" --build "${build}")
run("${build}/consumer")

# Nothing is built but the consumer's own file ...
file(READ "${build}/compile_commands.json" commands)
string(JSON count LENGTH "${commands}")
string(JSON file GET "${commands}" 0 file)
if(NOT count EQUAL 1 OR NOT file STREQUAL "${CMAKE_CURRENT_LIST_DIR}/main.cpp")
  message(FATAL_ERROR "consumer (${MODE}): icat adds files to the user's build:\n${commands}")
endif()

# ... and with no flags but include folders and the language standard.
string(JSON command GET "${commands}" 0 command)
if(command MATCHES " -[WDOfgmp][^ ]*")
  message(FATAL_ERROR "consumer (${MODE}): '${CMAKE_MATCH_0}' leaks to the user:\n${command}")
endif()
if(NOT command MATCHES " -std=(c|gnu)\\+\\+2")
  message(FATAL_ERROR "consumer (${MODE}): C++20 is not asked for:\n${command}")
endif()
