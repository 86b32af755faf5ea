# The C headers of MAVLink, which pymavlink's generator writes: target mavlink_headers.
if(NOT TARGET mavlink_headers)
  # [headers]
  set(MAVLINK_PYTHON "${PROJECT_SOURCE_DIR}/build/venv/bin/python" CACHE FILEPATH
    "Python that has pymavlink")
  set(mavlink_headers "${PROJECT_BINARY_DIR}/mavlink")
  if(NOT EXISTS "${mavlink_headers}/ardupilotmega/mavlink.h")
    execute_process(COMMAND "${MAVLINK_PYTHON}" -c
      "import os, pymavlink; print(os.path.dirname(pymavlink.__file__))"
      OUTPUT_VARIABLE pymavlink OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND "${MAVLINK_PYTHON}" -m pymavlink.tools.mavgen --lang=C
      --wire-protocol=2.0 "--output=${mavlink_headers}"
      "${pymavlink}/dialects/v20/ardupilotmega.xml"
      OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
  endif()
  add_library(mavlink_headers INTERFACE)
  target_include_directories(mavlink_headers SYSTEM INTERFACE "${mavlink_headers}")
  # [headers]
endif()
