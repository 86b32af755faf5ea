// SPDX-License-Identifier: BSD-3-Clause
// What is drawn over pictures, and written.
#pragma once

#include <icat/perception/line_tracker.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "eyes.hpp"

namespace perception {

/// Small, and of few levels, so that noise does not fill the file.
inline cv::Mat thumbnail(const cv::Mat& picture, int width) {
  cv::Mat small;
  cv::resize(picture, small, {width, picture.rows * width / picture.cols}, 0, 0, cv::INTER_AREA);
  cv::medianBlur(small, small, 3);
  small.forEach<cv::Vec3b>([](cv::Vec3b& p, const int*) {
    for (int c = 0; c < 3; ++c) p[c] = static_cast<unsigned char>((p[c] + 3) / 7 * 7);
  });
  return small;
}

/// Where the arm's mask is, darker; as in [MARIS, Fig. 16].
inline void draw_mask(cv::Mat& picture, const cv::Mat& mask) {
  cv::Mat full;
  cv::resize(mask, full, picture.size(), 0, 0, cv::INTER_NEAREST);
  cv::Mat marked = 0.4 * picture + cv::Scalar(60, 20, 20);
  marked.copyTo(picture, full);
}

/// The part of the line in the picture.
inline void draw_line(cv::Mat& picture, const icat::ContourLine<double>& line, cv::Scalar color) {
  const double c = std::cos(line.theta), s = std::sin(line.theta), far = 3000;
  const double u = picture.cols / 2.0, v = picture.rows / 2.0, d = c * u + s * v - line.rho;
  cv::Point a(cvRound(u - d * c - far * s), cvRound(v - d * s + far * c));
  cv::Point b(cvRound(u - d * c + far * s), cvRound(v - d * s - far * c));
  if (cv::clipLine(picture.size(), a, b)) cv::line(picture, a, b, color, 3, cv::LINE_AA);
}
inline void draw_segment(cv::Mat& picture, const icat::ContourSegment<double>& segment,
                         cv::Scalar color, int width = 3) {
  cv::line(picture, {cvRound(segment.from(0)), cvRound(segment.from(1))},
           {cvRound(segment.to(0)), cvRound(segment.to(1))}, color, width, cv::LINE_AA);
}

inline void write_title(cv::Mat& picture, const std::string& text) {
  cv::putText(picture, text, {10, picture.rows - 12}, cv::FONT_HERSHEY_SIMPLEX, 0.6, {0, 0, 0}, 4,
              cv::LINE_AA);
  cv::putText(picture, text, {10, picture.rows - 12}, cv::FONT_HERSHEY_SIMPLEX, 0.6,
              {255, 255, 255}, 1, cv::LINE_AA);
}

}  // namespace perception
