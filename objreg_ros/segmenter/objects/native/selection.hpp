// SPDX-License-Identifier: Apache-2.0
// The kernels of selection.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::selection {
constexpr double SLACK = 0.06;         // of the box's size: how far its edges are off without saying anything
constexpr double MIN_PURE = 0.6;       // a part with less of it in the box belongs to something else
constexpr double WHOLE = 0.95;         // a part with at least this much of it in the box is wholly there
constexpr double MIN_FIGURE = 0.25;    // a part with less of its depth jumps its own silhouette is background
constexpr double MIN_GAIN = 0.03;      // in fit: what another part must add
constexpr double SMALL_GAIN = 0.005;   // what a part must add that is wholly there and touches
constexpr i64 MIN_TOUCH = 3;           // cells that two parts of one object touch in
constexpr double GAP = 0.08;           // of the box's size: how far apart neighbouring parts of one object are
constexpr double GAP_GAIN = 0.25;      // what is added to it with the gain in fit
constexpr double GAP_ALIKE = 0.25;     // the same, for parts of one colour
constexpr double AS_WIDE = 0.7;        // of the width of both: what they share of it
constexpr double FELLOW_GAIN = 0.08;   // in fit: what a part must add that is only seen apart, as a seat from its back
constexpr double FELLOW_FIGURE = 0.5;  // such a part with less of its depth jumps its own silhouette is background
constexpr double FELLOW_DEPTH = 0.15;  // of its depth: how much nearer or farther such a part may be

using Box = std::array<i64, 4>;  // left, top, right, bottom in cells, half open
using Chosen = View<bool, 1>;

// The fields of `Parts` in parts.py, in their order.
using Fields = std::tuple<View<const i32, 2>, View<const double, 1>, View<const double, 1>, View<const i64, 2>,
                          View<const double, 1>, View<const double, 1>, View<const double, 1>, View<const bool, 2>,
                          View<const i64, 2>, View<const float, 2>, View<const i64, 2>>;
struct Parts {
  View<const i32, 2> labels;
  View<const double, 1> total, weight;
  View<const i64, 2> extent;
  View<const double, 1> size, pure, figure;
  View<const bool, 2> alike;
  View<const i64, 2> touching;
  View<const float, 2> gap;
  View<const i64, 2> front;
};

inline Box extent_of(const Parts &parts, i64 k) {
  return {parts.extent(k, 0), parts.extent(k, 1), parts.extent(k, 2), parts.extent(k, 3)};
}

inline Box united(const Box &a, const Box &b) {
  return {std::min(a[0], b[0]), std::min(a[1], b[1]), std::max(a[2], b[2]), std::max(a[3], b[3])};
}

inline Box chosen_extent(const Parts &parts, Chosen chosen) {
  Box extent{1 << 30, 1 << 30, -1, -1};
  for (i64 k = 0; k < chosen.size(); k++)
    if (chosen(k)) extent = united(extent, extent_of(parts, k));
  return extent;
}

inline double snapped(i64 edge, i64 target, double slack) {
  return edge + std::min(std::max(static_cast<double>(target - edge), -slack), slack);
}

// Intersection over union of two boxes, the first one's edges moved by up to SLACK towards the second one's.
inline double fit(const Box &extent, const Box &window) {
  const i64 width = window[2] - window[0], height = window[3] - window[1];
  const double slack_u = SLACK * width, slack_v = SLACK * height;
  const double left = snapped(extent[0], window[0], slack_u), right = snapped(extent[2], window[2], slack_u);
  const double top = snapped(extent[1], window[1], slack_v), bottom = snapped(extent[3], window[3], slack_v);
  const double wide = std::min<double>(right, window[2]) - std::max<double>(left, window[0]);
  const double tall = std::min<double>(bottom, window[3]) - std::max<double>(top, window[1]);
  if (wide <= 0 || tall <= 0) return 0.0;
  const double inner = wide * tall;
  return inner / ((right - left) * (bottom - top) + width * height - inner);
}

// The part that alone fits the box best.
inline i64 seed_of(const Parts &parts, const Box &window) {
  i64 best = 0;
  double most = -1.0;
  for (i64 k = 0; k < parts.total.size(); k++) {
    const double fitting = 0.1 + fit(extent_of(parts, k), window), pure = parts.pure(k);
    const double score = std::sqrt(parts.weight(k)) * (pure * pure) * (fitting * fitting) * (0.2 + parts.figure(k));
    if (score > most) best = k, most = score;
  }
  return best;
}

// Whether part k touches what is chosen.
inline bool touches(const Parts &parts, Chosen chosen, i64 k) {
  i64 cells = 0;
  for (i64 c = 0; c < chosen.size(); c++)
    if (chosen(c)) cells += parts.touching(c, k + 1);
  return cells >= MIN_TOUCH;
}

// Whether two extents lie above each other and are about as wide, as the inside and the outside of a bowl.
inline bool is_as_wide(const Box &a, const Box &b) {
  return std::min(a[2], b[2]) - std::max(a[0], b[0]) >= AS_WIDE * (std::max(a[2], b[2]) - std::min(a[0], b[0]));
}

// Whether a depth jump keeps part k from what is chosen, but no more than within one object. The jump may be the wider
// the more the part is needed to fill the box: its `gain` in fit.
inline bool is_close(const Parts &parts, Chosen chosen, i64 seed, i64 k, double gain) {
  for (i64 c = 0; c < chosen.size(); c++) {
    const double limit = (parts.alike(c, k) ? GAP_ALIKE : GAP + GAP_GAIN * gain) * parts.size(seed);
    if (chosen(c) && parts.gap(c, k + 1) < limit * limit) return true;
  }
  return false;
}

inline bool has_its_colour(const Parts &parts, Chosen chosen, i64 k) {
  bool has = false;
  for (i64 c = 0; c < chosen.size(); c++) has |= chosen(c) & parts.alike(c, k);
  return has;
}

// Whether part k, wholly in the box, has the colour of what is chosen and is about as far away.
inline bool is_fellow(const Parts &parts, Chosen chosen, i64 seed, i64 k) {
  // Sizes are those of the box at a part's depth.
  const bool as_far = std::abs(parts.size(k) / parts.size(seed) - 1) < FELLOW_DEPTH;
  const bool whole = parts.pure(k) >= WHOLE && parts.figure(k) >= FELLOW_FIGURE;
  return whole && as_far && has_its_colour(parts, chosen, k);
}

// Whether part k hides more of what is chosen than that hides of it.
inline bool hides(const Parts &parts, Chosen chosen, i64 k) {
  i64 lead = 0;
  for (i64 c = 0; c < chosen.size(); c++)
    if (chosen(c)) lead += parts.front(k, c + 1) - parts.front(c, k + 1);
  return lead > 0;
}

// Whether part k hides what is chosen, and has another colour.
inline bool lies_on(const Parts &parts, Chosen chosen, i64 k) {
  return hides(parts, chosen, k) && !has_its_colour(parts, chosen, k);
}

// The part that adds most to the fit of what is chosen; -1 if none adds enough.
inline i64 best_addition(const Parts &parts, Chosen chosen, i64 seed, const Box &window) {
  const Box extent = chosen_extent(parts, chosen);
  const double now = fit(extent, window);
  i64 best = -1;
  double most = 0.0;
  for (i64 k = 0; k < chosen.size(); k++) {
    if (chosen(k) || parts.pure(k) < MIN_PURE) continue;
    const double gain = fit(united(extent, extent_of(parts, k)), window) - now;
    if (gain <= most || gain <= SMALL_GAIN) continue;
    const bool touching = touches(parts, chosen, k);
    const double stretch = is_as_wide(extent, extent_of(parts, k)) ? gain : 0.0;
    const bool no_background = parts.figure(k) >= MIN_FIGURE || has_its_colour(parts, chosen, k);
    const bool near = touching || (no_background && is_close(parts, chosen, seed, k, stretch));
    if (!near && !(gain > FELLOW_GAIN && is_fellow(parts, chosen, seed, k))) continue;
    if (gain > MIN_GAIN || (touching && parts.pure(k) >= WHOLE && !lies_on(parts, chosen, k))) best = k, most = gain;
  }
  return best;
}

// Add to `chosen` the parts within its extent that lie next to it and do not hide it.
inline void add_enclosed(const Parts &parts, Chosen chosen, i64 seed, const Box &window) {
  const auto [left, top, right, bottom] = chosen_extent(parts, chosen);
  const double slack_u = SLACK * (window[2] - window[0]), slack_v = SLACK * (window[3] - window[1]);
  Array<bool, 1> before(chosen.size());
  std::copy_n(chosen.data, chosen.size(), before.data);
  for (i64 k = 0; k < chosen.size(); k++) {
    const auto [a, b, c, d] = extent_of(parts, k);
    const bool within = a >= left - slack_u && b >= top - slack_v && c <= right + slack_u && d <= bottom + slack_v;
    const bool own =
        parts.figure(k) >= MIN_FIGURE && has_its_colour(parts, before, k) && !hides(parts, before, k);
    if (before(k) || !(within || own) || parts.pure(k) < WHOLE || lies_on(parts, before, k)) continue;
    chosen(k) = touches(parts, before, k) || is_close(parts, before, seed, k, 0.0);
  }
}

// (1 + K,) bool: which parts, by their numbers, are the object.
inline Array<bool, 1> choose(const Parts &parts, const Box &window) {
  auto table = zeros<bool, 1>(parts.total.size() + 1);
  if (parts.total.size() == 0) return table;
  const Chosen chosen = table.from(1);
  const i64 seed = seed_of(parts, window);
  for (i64 best = seed; best >= 0; best = best_addition(parts, chosen, seed, window)) chosen(best) = true;
  add_enclosed(parts, chosen, seed, window);
  return table;
}

// (h, w) bool: the cells of the parts that are the object in `window`.
inline Array<bool, 2> select(Fields fields, Box window) {
  const Parts parts = std::apply([](auto... field) { return Parts{field...}; }, fields);
  const auto table = choose(parts, window);
  const i64 h = parts.labels.shape[0], w = parts.labels.shape[1];
  Array<bool, 2> cells(h, w);
  for (i64 i = 0; i < h; i++)
    for (i64 j = 0; j < w; j++) cells(i, j) = table(parts.labels(i, j));
  return cells;
}

inline PyMethodDef METHODS[] = {
    binding::method<select>("select", "The cells of the parts that are the object in a window."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::selection
