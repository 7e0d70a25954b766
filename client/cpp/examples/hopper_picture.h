// Draws the hopper's motion as an animated picture.
#pragma once

#include <marble/examples.h>

#include <array>
#include <string>
#include <vector>

/// One control step of the closed loop.
struct Tick {
  std::array<double, 4> position;  ///< x, z of the body, x, z of the foot, m
  std::vector<double> plan;        ///< from there on, as the solver returned it
};

/// Returns an SVG that plays in real time in a loop: ground, body, leg and foot, and the robot's plan at each
/// control step. A viewer without animation shows the paths of body and foot and the first control step.
std::string draw(const marble::examples::HopperParameters& robot, const std::vector<Tick>& way);
