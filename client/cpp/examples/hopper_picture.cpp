#include "hopper_picture.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

namespace {

using namespace marble::examples;

constexpr double kScale = 320.0;  // pixels per metre
constexpr double kLow = -0.15, kHigh = 1.25, kLeft = -0.3;

std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string text(const char* format, ...) {
  char buffer[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

double px(double x) { return kScale * (x - kLeft); }
double py(double z) { return kScale * (kHigh - z); }
std::string point(double x, double z) { return text("%.1f,%.1f ", px(x), py(z)); }

// Returns the stairs as an outline from left to right and back below.
std::string ground(const HopperParameters& robot, double right) {
  double height = 0.0;
  std::string points = point(kLeft, kLow) + point(kLeft, height);
  for (std::size_t i = 0; i < robot.stair_x.size(); ++i) {
    points += point(robot.stair_x[i], height);
    height += robot.stair_rise[i];
    points += point(robot.stair_x[i], height);
  }
  return "<polygon fill='#d9d4c7' points='" + points + point(right, height) + point(right, kLow) + "'/>\n";
}

// Returns the scale in metres along the ground, and the legend of the colours.
std::string words(double right) {
  std::string result = "<g font-family='sans-serif' font-size='14' fill='#555'>\n";
  for (double x = 0.0; x < right; x += 0.5)
    result += text("<text x='%.1f' y='%.1f' text-anchor='middle'>%g</text>", px(x), py(kLow) - 8.0, x);
  result += text("<text x='%.1f' y='%.1f'>m</text>\n", px(right) - 20.0, py(kLow) - 8.0);
  return result +
         "<text x='16' y='24'><tspan fill='#2563a8'>body</tspan> and <tspan fill='#c2481f'>foot</tspan>: "
         "their way, and dashed what was planned at each tick</text>\n</g>\n";
}

// Returns an attribute that moves through the `value` of each control step.
template <class Value>
std::string moving(const char* attribute, const std::vector<Tick>& way, double seconds, Value&& value) {
  std::string values;
  for (const Tick& tick : way) values += (values.empty() ? "" : ";") + value(tick);
  return text("<animate attributeName='%s' dur='%.2fs' repeatCount='indefinite' values='", attribute,
              seconds) +
         values + "'/>";
}

// Returns the planned path of body or foot: from the robot's position, then at the end of each step of the
// plan.
std::string planned(const Tick& tick, int x, int z) {
  std::string points =
      point(tick.position[static_cast<std::size_t>(x)], tick.position[static_cast<std::size_t>(z)]);
  for (std::size_t k = 0; k + kHopperVariables <= tick.plan.size(); k += kHopperVariables)
    points += point(tick.plan[k + static_cast<std::size_t>(x)], tick.plan[k + static_cast<std::size_t>(z)]);
  return points;
}

std::string line(const char* style, const std::string& points, const std::string& inside = "") {
  return std::string("<polyline fill='none' ") + style + " points='" + points + "'>" + inside +
         "</polyline>\n";
}

std::string disc(const char* color, int radius, std::size_t x, const std::vector<Tick>& way, double seconds) {
  const auto at_x = [x](const Tick& tick) { return text("%.1f", px(tick.position[x])); };
  const auto at_z = [x](const Tick& tick) { return text("%.1f", py(tick.position[x + 1])); };
  return text("<circle r='%d' fill='%s' cx='%s' cy='%s'>", radius, color, at_x(way[0]).c_str(),
              at_z(way[0]).c_str()) +
         moving("cx", way, seconds, at_x) + moving("cy", way, seconds, at_z) + "</circle>\n";
}

}  // namespace

std::string draw(const HopperParameters& robot, const std::vector<Tick>& way) {
  if (way.empty()) return "";
  const double seconds = robot.step_s * static_cast<double>(way.size());
  double right = 0.0;
  std::string body_way, foot_way;
  for (const Tick& tick : way) {
    right = std::max(right, tick.position[0]);
    body_way += point(tick.position[0], tick.position[1]);
    foot_way += point(tick.position[2], tick.position[3]);
  }
  right = std::max(right, robot.stair_x.back()) + 0.4;
  const auto leg = [](const Tick& tick) {
    return point(tick.position[0], tick.position[1]) + point(tick.position[2], tick.position[3]);
  };
  std::string legs;
  for (std::size_t i = 0; i < way.size(); i += 4)
    legs += line("stroke='#8a8f98' stroke-opacity='0.25'", leg(way[i]));
  const auto body_plan = [](const Tick& tick) { return planned(tick, kBodyX, kBodyZ); };
  const auto foot_plan = [](const Tick& tick) { return planned(tick, kFootX, kFootZ); };
  const char* const dashed = "stroke-width='1.5' stroke-dasharray='3 4' stroke=";
  return text("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %.0f %.0f'>\n", px(right), py(kLow)) +
         "<rect width='100%' height='100%' fill='white'/>\n" + ground(robot, right) + words(right) + legs +
         line("stroke='#2563a8' stroke-opacity='0.4'", body_way) +
         line("stroke='#c2481f' stroke-opacity='0.4'", foot_way) +
         line((std::string(dashed) + "'#2563a8'").c_str(), body_plan(way[0]),
              moving("points", way, seconds, body_plan)) +
         line((std::string(dashed) + "'#c2481f'").c_str(), foot_plan(way[0]),
              moving("points", way, seconds, foot_plan)) +
         line("stroke='#8a8f98' stroke-width='4'", leg(way[0]), moving("points", way, seconds, leg)) +
         disc("#2563a8", 16, kBodyX, way, seconds) + disc("#c2481f", 8, kFootX, way, seconds) + "</svg>\n";
}
