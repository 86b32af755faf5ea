// SPDX-License-Identifier: BSD-3-Clause
#include "reasons.hpp"

#include <ctime>
#include <icat/control/explain.hpp>
#include <icat/cooperation/agent_inside.hpp>
#include <optional>

#include "recorder.hpp"

namespace support {

template <class Controller>
struct Reasons<Controller>::Recorded {
  std::optional<icat::Explainer<Controller>> explainer;
  std::vector<std::pair<double, std::string>> sentences;
  double next = 0;
  std::clock_t took = 0;
};

template <class Controller>
Reasons<Controller>::Reasons() : recorded_(std::make_unique<Recorded>()) {}
template <class Controller>
Reasons<Controller>::~Reasons() = default;
template <class Controller>
Reasons<Controller>::Reasons(Reasons&&) noexcept = default;
template <class Controller>
Reasons<Controller>& Reasons<Controller>::operator=(Reasons&&) noexcept = default;

template <class Controller>
void Reasons<Controller>::record(double t, const Controller& controller) {
  Recorded& r = *recorded_;
  if (t < r.next) return;
  r.next = t + 0.25;  // s: as often as a person reads
  const std::clock_t begin = std::clock();
  if (!r.explainer) r.explainer.emplace(controller);
  r.explainer->update();
  r.sentences.emplace_back(t, r.explainer->conclusion());
  r.took += std::clock() - begin;
}
template <class Controller>
const std::vector<std::pair<double, std::string>>& Reasons<Controller>::sentences() const {
  return recorded_->sentences;
}
template <class Controller>
double Reasons<Controller>::seconds() const {
  return static_cast<double>(recorded_->took) / CLOCKS_PER_SEC;
}

template class Reasons<icat::Controller<Uvms>>;
template class Reasons<icat::Controller<icat::KinematicTree<double, 8>>>;  // 03_nsb_dual_arm
template class Reasons<icat::ParallelController<Uvms>>;
template class Reasons<icat::Agent<Uvms>>;

}  // namespace support
