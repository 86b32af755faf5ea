# Installs icat, then configures, builds and runs the user's project beside this file.
# The parameters are those that ../CMakeLists.txt passes.
cmake_minimum_required(VERSION 3.22)

# What the user's project gets must come from its own lines.
foreach(variable CXXFLAGS LDFLAGS CMAKE_BUILD_TYPE)
  unset(ENV{${variable}})
endforeach()

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed (${result}): ${ARGV}")
  endif()
endfunction()

# By the environment, because a list would fall apart in the call.
set(ENV{CMAKE_PREFIX_PATH} "${WORK_DIR}/prefix:${PINOCCHIO_PREFIX}")
# The build folder stays: what it holds is slow to compile.
run("${CMAKE_COMMAND}" --install "${ICAT_BINARY_DIR}" --prefix "${WORK_DIR}/prefix")
run("${CMAKE_COMMAND}" -S "${CMAKE_CURRENT_LIST_DIR}" -B "${WORK_DIR}/build"
  -G "${CMAKE_GENERATOR}"
  "-DROBOT_DATA=${ROBOT_DATA}"
  "-DSNAPSHOT=${SNAPSHOT}"
  "-DCMAKE_BUILD_TYPE=Release"
  "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG"
  "-DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER}"
  "-DCMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}"
  "-DEigen3_DIR=${Eigen3_DIR}")
run("${CMAKE_COMMAND}" --build "${WORK_DIR}/build")
run("${WORK_DIR}/build/test_pinocchio")
