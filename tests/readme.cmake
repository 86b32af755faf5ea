# SPDX-License-Identifier: BSD-3-Clause
# The README's program is the example, word for word, and its output is what the example prints.
# cmake -DSOURCE_DIR=... -DPROGRAM=... -P readme.cmake
file(READ "${SOURCE_DIR}/README.md" readme)
file(READ "${SOURCE_DIR}/examples/00_reach/main.cpp" example)
string(REGEX REPLACE "^// SPDX[^\n]*\n" "" example "${example}")
string(FIND "${readme}" "```cpp\n${example}```" at)
if(at EQUAL -1)
  message(FATAL_ERROR "README.md does not contain examples/00_reach/main.cpp")
endif()
execute_process(COMMAND "${PROGRAM}" OUTPUT_VARIABLE output RESULT_VARIABLE result)
string(FIND "${readme}" "```\n${output}```" at)
if(NOT result EQUAL 0 OR at EQUAL -1)
  message(FATAL_ERROR "README.md does not show what the program prints: ${output}")
endif()
