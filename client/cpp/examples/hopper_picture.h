// The hopper's way as a moving picture.
#pragma once

#include <marble/examples.h>

#include <array>
#include <string>
#include <vector>

/// One tick of the closed loop.
struct Tick {
  std::array<double, 4> position;  ///< x, z of the body, x, z of the foot, m
  std::vector<double> plan;        ///< from there on, as the solver gave it
};

/// An SVG, in real time and again and again: ground, body, leg and foot, and what the robot planned at each
/// tick. A viewer that shows no movement shows the way of body and foot and the first tick.
std::string draw(const marble::examples::HopperParameters& robot, const std::vector<Tick>& way);
