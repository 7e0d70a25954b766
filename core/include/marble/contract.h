// The constants of contract.def: what clients and servers both know.
#pragma once

namespace marble::contract {

#define MARBLE_CONSTANT(name, value, unit, doc) inline constexpr auto name = value;
#include "marble/contract.def"

}  // namespace marble::contract
