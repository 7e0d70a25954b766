#include <algorithm>

#include "macmpec/problems.h"
#include "marble/macmpec.h"

namespace marble::examples {
namespace {

using namespace macmpec_sources;

constexpr const char* kBard = "J. F. Bard, Convex two-level optimization, Math. Programming 40, 1988";
constexpr const char* kDirkse = "J. F. Bard, 1988, as in MPECLIB by S. Dirkse";
constexpr const char* kFacchinei =
    "F. Facchinei, H. Jiang, L. Qi, A smoothing method for mathematical programs with equilibrium "
    "constraints, Math. Programming 85, 1999";
constexpr const char* kFloudas =
    "C. A. Floudas et al., Handbook of Test Problems in Local and Global Optimization, Kluwer, 1999, ch. 9";
constexpr const char* kFukushima =
    "M. Fukushima, Z.-Q. Luo, J.-S. Pang, A globally convergent sequential quadratic programming algorithm "
    "for mathematical programs with linear complementarity constraints, Comp. Opt. Appl. 10, 1998";
constexpr const char* kJiangRalph =
    "H. Jiang, D. Ralph, Smooth SQP methods for mathematical programs with nonlinear complementarity "
    "constraints, SIAM J. Optimization 10, 2000";
constexpr const char* kHs044 =
    "S. Scholtes and S. Leyffer in MacMPEC, of W. Hock, K. Schittkowski, Test Examples for Nonlinear "
    "Programming Codes, 1981, no. 44";
constexpr const char* kHs021 =
    "S. Scholtes and S. Leyffer in MacMPEC, of W. Hock, K. Schittkowski, Test Examples for Nonlinear "
    "Programming Codes, 1981, no. 21";
constexpr const char* kLiswet =
    "S. Scholtes and S. Leyffer in MacMPEC, of W. Li, J. Swetits, A Newton method for convex regression, "
    "data "
    "smoothing, and quadratic programming with bounded constraints, SIAM J. Optimization 3, 1993";
constexpr const char* kPortfolio =
    "S. Scholtes and S. Leyffer in MacMPEC, of PORTFL1 to 6 in CUTE, which follow W. Sharpe";
constexpr const char* kGauvin =
    "J. Gauvin, G. Savard, working paper G9037, GERAD, 1992, as in MPECLIB by S. Dirkse and M. Ferris";
constexpr const char* kLeyffer = "S. Leyffer, MacMPEC";
constexpr const char* kScholtes = "S. Scholtes in MacMPEC";

constexpr MacmpecProblem kProblems[] = {
    {"bard1", kBard, 17.0, bard1},
    {"bard1m", kDirkse, 17.0, bard1m},
    {"bard2", kBard, -6598.0, bard2},
    {"bilevel2", kFacchinei, -6600.0, bilevel2},
    {"bilevel2m", kFacchinei, -6600.0, bilevel2m},
    {"ex9_2_1", kFloudas, 17.0, [] { return bard1_with_slacks("ex9_2_1"); }},
    {"ex9_2_2", kFloudas, 100.0, ex9_2_2},
    {"ex9_2_4", kFloudas, 0.5, ex9_2_4},
    {"ex9_2_5", kFloudas, 5.0, ex9_2_5},
    {"ex9_2_6", kFloudas, -1.0, ex9_2_6},
    {"ex9_2_7", kFloudas, 17.0, [] { return bard1_with_slacks("ex9_2_7"); }},
    {"flp2", kFukushima, 0.0, flp2},
    {"flp4_1", kFukushima, 0.0, [] { return flp4("flp4_1", 1); }},
    {"flp4_2", kFukushima, 0.0, [] { return flp4("flp4_2", 2); }},
    {"flp4_3", kFukushima, 0.0, [] { return flp4("flp4_3", 3); }},
    {"flp4_4", kFukushima, 0.0, [] { return flp4("flp4_4", 4); }},
    {"gauvin", kGauvin, 20.0, gauvin},
    {"hs044_i", kHs044, 15.6177688889, hs044_i},
    {"jr1", kJiangRalph, 0.5, [] { return jr("jr1", 1.0, 0.0); }},
    {"jr2", kJiangRalph, 0.5, [] { return jr("jr2", 0.0, 1.0); }},
    {"kth2", kLeyffer, 0.0, kth2},
    {"kth3", kLeyffer, 0.5, kth3},
    {"liswet1_050", kLiswet, 0.0139942823822, [] { return liswet1("liswet1_050", 50, 50); }},
    {"liswet1_100", kLiswet, 0.0137339343403, [] { return liswet1("liswet1_100", 100, 101); }},
    {"liswet1_200", kLiswet, 0.0170085879552, [] { return liswet1("liswet1_200", 200, 201); }},
    {"nash1a", kFacchinei, 0.0, [] { return nash1("nash1a", 0.0, 0.0); }},
    {"nash1b", kFacchinei, 0.0, [] { return nash1("nash1b", 5.0, 5.0); }},
    {"nash1c", kFacchinei, 0.0, [] { return nash1("nash1c", 10.0, 10.0); }},
    {"nash1d", kFacchinei, 0.0, [] { return nash1("nash1d", 10.0, 0.0); }},
    {"nash1e", kFacchinei, 0.0, [] { return nash1("nash1e", 0.0, 10.0); }},
    {"portfl1", kPortfolio, 1.50242076711e-05, [] { return portfl("portfl1", 1); }},
    {"portfl2", kPortfolio, 1.45728265151e-05, [] { return portfl("portfl2", 2); }},
    {"portfl3", kPortfolio, 6.26498180907e-06, [] { return portfl("portfl3", 3); }},
    {"portfl4", kPortfolio, 2.17733524138e-06, [] { return portfl("portfl4", 4); }},
    {"portfl6", kPortfolio, 2.36132954689e-06, [] { return portfl("portfl6", 6); }},
    {"qpec1", kJiangRalph, 80.0, [] { return qpec("qpec1", 1.0, 10); }},
    {"qpec2", kJiangRalph, 45.0, [] { return qpec("qpec2", -1.0, 10); }},
    {"scholtes3", kScholtes, 0.5, scholtes3},
    {"sl1", kHs021, 1e-4, sl1},
};

}  // namespace

std::span<const MacmpecProblem> macmpec() { return kProblems; }

const MacmpecProblem* find_macmpec(std::string_view name) {
  const auto* const found = std::ranges::find(kProblems, name, &MacmpecProblem::name);
  return found == std::end(kProblems) ? nullptr : found;
}

}  // namespace marble::examples
