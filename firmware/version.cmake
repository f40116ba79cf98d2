# PROJECT_VER, which ESP-IDF writes into the image: the version that the firmware says, and that updates are compared by.
file(STRINGS ${CMAKE_CURRENT_LIST_DIR}/core/report.h version_line REGEX "kFirmwareVersion = ")
string(REGEX REPLACE ".*\"([^\"]+)\".*" "\\1" PROJECT_VER "${version_line}")
