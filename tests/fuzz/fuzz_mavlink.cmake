include("${PROJECT_SOURCE_DIR}/tests/hardware/support/mavlink_headers.cmake")
target_link_libraries(${name} PRIVATE mavlink_headers)
