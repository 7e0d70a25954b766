// The constants of contract.def, which clients and servers share.
#pragma once

namespace marble::contract {

#define MARBLE_CONSTANT(name, value, unit, doc) inline constexpr auto name = value;
#include "marble/contract.def"

}  // namespace marble::contract
