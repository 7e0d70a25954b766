// Problems that begin near a pole, where curvature is up to 1e16 times that at the solution; of any scalars
// with log, exp and pow. Solutions are closed forms.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace marble::testing {

template <class T>
struct PoleParts {
  T objective;
  std::vector<T> equalities = {};
  std::vector<T> inequalities = {};
  std::vector<T> G = {};  // complements the variable that `complement` names
};

template <class T>
struct PoleProblem {
  std::string name;
  std::vector<double> solution;
  std::function<PoleParts<T>(const std::vector<T>& x)> parts;
  std::function<std::vector<double>(double distance)> start;  // at this distance from the pole
  std::vector<double> lower, upper;
  int complement = -1;
  int most_lcqps = 50;
};

inline constexpr double kPoleDistances[] = {1e-2, 1e-4, 1e-6, 1e-8};

namespace poles {

/// Of one variable in [0, 10], with the pole at 0.
template <class T>
PoleProblem<T> of_one(const char* name, double solution, std::function<T(const T&)> objective) {
  return {name,
          {solution},
          [objective = std::move(objective)](const std::vector<T>& x) {
            return PoleParts<T>{.objective = objective(x[0])};
          },
          [](double distance) { return std::vector{distance}; },
          {0.0},
          {10.0}};
}

template <class T>
T square(const T& a) {
  return a * a;
}

template <class T>
std::vector<PoleProblem<T>> of_one_variable() {
  const double logistic = 1.0 / (1.0 + std::exp(-1.0));
  return {
      of_one<T>("x - log x", 1.0, [](const T& x) { return x - log(x); }),
      of_one<T>("1/x + x", 1.0, [](const T& x) { return 1.0 / x + x; }),
      of_one<T>("(log x - 1)^2", std::exp(1.0), [](const T& x) { return square(log(x) - 1.0); }),
      of_one<T>("x log x", std::exp(-1.0), [](const T& x) { return x * log(x); }),
      of_one<T>("x^1.5 - x", 4.0 / 9.0, [](const T& x) { return pow(x, 1.5) - x; }),
      of_one<T>("x - sqrt x", 0.25, [](const T& x) { return x - pow(x, 0.5); }),
      of_one<T>("1/x^2 + x", std::cbrt(2.0), [](const T& x) { return pow(x, -2.0) + x; }),
      of_one<T>("1/sqrt x + x", std::pow(0.5, 2.0 / 3.0), [](const T& x) { return pow(x, -0.5) + x; }),
      of_one<T>("(1/x - 1)^2", 1.0, [](const T& x) { return square(1.0 / x - 1.0); }),
      of_one<T>("x^2/2 - log x", 1.0, [](const T& x) { return 0.5 * square(x) - log(x); }),
      of_one<T>("x - 0.001 log x", 1e-3, [](const T& x) { return x - 1e-3 * log(x); }),
      of_one<T>("100 x - log x", 1e-2, [](const T& x) { return 100.0 * x - log(x); }),
      of_one<T>("-log x - log(10 - x)", 5.0, [](const T& x) { return -log(x) - log(10.0 - x); }),
      of_one<T>("exp(x) - e log x", 1.0, [](const T& x) { return exp(x) - std::exp(1.0) * log(x); }),
      of_one<T>("softplus barrier", 1.0,
                [logistic](const T& x) { return log(1.0 + exp(x)) - logistic * log(x); }),
      of_one<T>(
          "logistic loss and barrier", 1.0,
          [logistic](const T& x) { return log(1.0 + exp(-x)) + (1.01 - logistic) * x - 0.01 * log(x); }),
  };
}

template <class T>
std::vector<PoleProblem<T>> of_more_variables() {
  const auto first = [](double distance) { return std::vector{distance, 0.0, 1.5}; };
  const auto two = [](double distance) { return std::vector{distance, 1.0}; };
  return {
      {"pole at an upper bound",
       {0.5},
       [](const std::vector<T>& x) { return PoleParts<T>{.objective = -log(1.0 - x[0]) - 2.0 * x[0]}; },
       [](double distance) { return std::vector{1.0 - distance}; },
       {-10.0},
       {1.0}},
      {"barrier beside a pair",
       {1.0, 0.0, 2.0},
       [](const std::vector<T>& x) {
         return PoleParts<T>{.objective = x[0] - log(x[0]) + square(x[1] - 1.0) + square(x[2] - 2.0),
                             .G = {x[1]}};
       },
       first,
       {0.0, 0.0, 0.0},
       {10.0, 10.0, 10.0},
       2},
      {"two logarithms and a pair",
       {std::exp(1.0), 1.0, 0.0},
       [](const std::vector<T>& x) {
         return PoleParts<T>{.objective = square(log(x[0]) - 1.0) + square(log(x[1])) + 0.1 * x[2],
                             .G = {3.0 - x[0]}};
       },
       [](double distance) {
         return std::vector{distance, distance, 0.0};
       },
       {0.0, 0.0, 0.0},
       {10.0, 10.0, 10.0},
       2},
      {"pole within a pair",
       {0.5, 0.1},
       [](const std::vector<T>& x) {
         return PoleParts<T>{.objective = square(x[0] - 1.0) + square(x[1] - 0.1), .G = {1.0 / x[0] - 2.0}};
       },
       two,
       {0.0, 0.0},
       {10.0, 10.0},
       1,
       60},
      {"two logarithms on a line",
       {1.0, 2.0},
       [](const std::vector<T>& x) {
         return PoleParts<T>{.objective = -log(x[0]) - 2.0 * log(x[1]), .equalities = {x[0] + x[1] - 3.0}};
       },
       two,
       {0.0, 0.0},
       {10.0, 10.0}},
      {"logarithm in a row",
       {1.0, 0.0},
       [](const std::vector<T>& x) {
         return PoleParts<T>{.objective = x[0] + square(x[1] - 0.5), .inequalities = {log(x[0]) - x[1]}};
       },
       [](double distance) {
         return std::vector{distance, 0.0};
       },
       {0.0, -10.0},
       {10.0, 10.0}},
  };
}

}  // namespace poles

template <class T>
std::vector<PoleProblem<T>> pole_problems() {
  std::vector<PoleProblem<T>> all = poles::of_one_variable<T>();
  for (auto& problem : poles::of_more_variables<T>()) all.push_back(std::move(problem));
  return all;
}

}  // namespace marble::testing
