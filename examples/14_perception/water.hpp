// SPDX-License-Identifier: BSD-3-Clause
// The image of surfaces through water, light and a sensor: for each channel, with the attenuation c
// = a + b of absorption and scattering,
//
//     picture = albedo (sun + lamps) exp(−c range) + backscatter
//     sun     = exp(−k depth);  its backscatter = g b / c (1 − exp(−c range)) at the camera
//     lamps   = intensity / r² exp(−c r); theirs: the integral of intensity / r² g b exp(−2 c r)
//
// then blur, exposure to a wanted mean, shot and read noise, eight bits.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace perception {

/// 1/m; red, green, blue. Clear pool water absorbs red.
struct Water {
  std::array<double, 3> absorption{0.30, 0.06, 0.04};
  double scattering = 0.03;  ///< b
  double attenuation(int c) const { return absorption[static_cast<std::size_t>(c)] + scattering; }
};

/// Where the light comes from, and what the camera makes of it.
struct Light {
  double sun = 1;           ///< at the surface of the water
  double lamps = 0;         ///< of the headlights, at 1 m
  double full_well = 9000;  ///< electrons of level 255: less where gain makes up for light
  double wanted_mean = 85;  ///< of the brightest channel: the exposure
  std::array<double, 3> balance{1.9, 1, 0.9};  ///< gains of the camera's red, green, blue
};

/// What a ray of one pixel meets.
struct Surface {
  float range = 0, depth = 0;  ///< m
  float sun = 0, lamp = 0;     ///< shares of both lights that fall on it
  std::array<float, 3> albedo{};
};

/// A stage of the renderer with buffers of its own.
class Sensor {
 public:
  explicit Sensor(std::uint64_t seed) : random_(seed) {
    bank_.create(1, 1 << 18, CV_32F);
    random_.fill(bank_, cv::RNG::NORMAL, 0, 1);
  }

  /// Eight bits, blue green red. `depth` is the camera's, m.
  cv::Mat take(const std::vector<Surface>& seen, cv::Size size, double depth, const Water& water,
               const Light& light) {
    tabulate(depth, water, light);
    radiance_.create(size, CV_32FC3);
    cv::parallel_for_(cv::Range(0, size.height), [&](const cv::Range& rows) {
      for (int j = rows.start; j < rows.end; ++j) {
        auto* const row = radiance_.ptr<cv::Vec3f>(j);
        const Surface* s = &seen[static_cast<std::size_t>(j * size.width)];
        for (int i = 0; i < size.width; ++i, ++s) {
          const std::size_t r = entry(s->range), d = entry(s->depth);
          for (std::size_t c = 0; c < 3; ++c) {
            const Table& t = tables_[c];
            row[i][static_cast<int>(2 - c)] =
                float(light.balance[c]) *
                (s->albedo[c] * (s->sun * t.sun[d] + s->lamp * t.lamp[r]) * t.through[r] +
                 t.veil[r]);
          }
        }
      }
    });
    // The lens, and light scattered forwards.
    cv::GaussianBlur(radiance_, radiance_, cv::Size(), 0.6 + 0.5 * water.scattering);
    const cv::Scalar mean = cv::mean(radiance_);
    const double gain = light.wanted_mean / std::max({mean[0], mean[1], mean[2], 1e-9});
    const double electrons = light.full_well / 255, read = 8;
    cv::Mat picture(size, CV_8UC3);
    for (int j = 0; j < size.height; ++j) {
      const float* const from = radiance_.ptr<float>(j);
      unsigned char* const to = picture.ptr<unsigned char>(j);
      const int n = 3 * size.width;
      const float* const noise = bank_.ptr<float>(0) + random_.uniform(0, (1 << 18) - n);
      for (int i = 0; i < n; ++i) {
        const double level = gain * from[i];
        const double deviation = std::sqrt(level * electrons + read * read) / electrons;
        to[i] = cv::saturate_cast<unsigned char>(level + deviation * noise[i]);
      }
    }
    return picture;
  }

 private:
  static constexpr int entries = 4000;
  static constexpr double step = 0.0025;  // m
  struct Table {
    std::array<float, entries> sun, lamp, through, veil;
  };
  static std::size_t entry(float x) {
    return static_cast<std::size_t>(std::clamp(int(x / float(step)), 0, entries - 1));
  }

  void tabulate(double depth, const Water& water, const Light& light) {
    constexpr double back = 0.06;  // g, 1/sr
    for (int c = 0; c < 3; ++c) {
      Table& t = tables_[static_cast<std::size_t>(c)];
      const double a = water.absorption[static_cast<std::size_t>(c)], b = water.scattering;
      const double attenuation = a + b, diffuse = a + 0.15 * b;
      const double at_camera = light.sun * std::exp(-diffuse * depth);
      double lamps = 0;
      for (int i = 0; i < entries; ++i) {
        const double x = (i + 0.5) * step, through = std::exp(-attenuation * x);
        // The beams of lamps beside the camera enter its view at 0.8 m.
        if (x > 0.8) lamps += step * light.lamps * back * b / (x * x) * through * through;
        const auto k = static_cast<std::size_t>(i);
        t.through[k] = static_cast<float>(through / CV_PI);
        t.sun[k] = static_cast<float>(light.sun * std::exp(-diffuse * x));
        t.lamp[k] = static_cast<float>(light.lamps * through);
        t.veil[k] = static_cast<float>(at_camera * back * b / attenuation * (1 - through) + lamps);
      }
    }
  }

  cv::RNG random_;
  cv::Mat bank_, radiance_;
  std::array<Table, 3> tables_;
};

/// A line of [MARIS, Fig. 13].
struct Condition {
  const char* name;
  const char* file;
  Water water;
  Light light;
};

/// Clear water with what scatters in it, by `scattering` (1/m): it is green.
inline Water turbid(double scattering) {
  Water w;
  w.scattering = scattering;
  w.absorption = {0.30 + 0.15 * scattering, 0.06 + 0.04 * scattering, 0.04 + 0.15 * scattering};
  return w;
}
constexpr double clear = 0.03;

inline std::array<Condition, 4> conditions() {
  const Light day{}, night{.sun = 0.002, .lamps = 1, .full_well = 4000, .wanted_mean = 60};
  return {{{"day, clear", "day_clear", turbid(clear), day},
           {"night, clear, headlights", "night_clear", turbid(clear), night},
           {"slightly turbid", "slightly_turbid", turbid(0.55), day},
           {"very turbid", "very_turbid", turbid(1.8), day}}};
}

}  // namespace perception
