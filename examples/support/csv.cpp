// SPDX-License-Identifier: BSD-3-Clause
#include "csv.hpp"

#include <filesystem>

namespace support {

TextFile::TextFile(const std::string& folder, const std::string& name)
    : file_(nullptr, [](std::FILE* file) { return file ? std::fclose(file) : 0; }) {
  std::filesystem::create_directories(folder);
  file_.reset(std::fopen((std::filesystem::path(folder) / name).c_str(), "w"));
}
bool TextFile::written() const {
  return file_ && std::fflush(file_.get()) == 0 && std::ferror(file_.get()) == 0;
}
void TextFile::put(const char* text) {
  if (file_) std::fputs(text, file_.get());
}
void TextFile::put(double value) {
  if (file_) std::fprintf(file_.get(), "%.9g", value);
}

Csv::Csv(const std::string& folder, const std::string& name, const std::string& header)
    : TextFile(folder, name) {
  put((header + '\n').c_str());
}
void Csv::add(double value) {
  put(comma_);
  put(value);
  comma_ = ",";
}
void Csv::end() {
  put("\n");
  comma_ = "";
}

Strokes::Strokes(const std::string& folder, const std::string& name) : TextFile(folder, name) {}
void Strokes::add(double x, double y, double z) {
  put(x);
  put(",");
  put(y);
  put(",");
  put(z);
  put("\n");
}
void Strokes::end() { put("\n\n"); }

}  // namespace support
