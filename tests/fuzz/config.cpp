// The configuration file: faults with their lines, or a configuration that prints as a file which says the
// same.
#include "config/config.h"

#include <cstdint>
#include <string_view>

#include "config/config_file.h"
#include "expect.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble::server;
  Config config;
  std::vector<ConfigFault> faults;
  read_config_text({reinterpret_cast<const char*>(data), size}, "fuzz", config, faults);
  for (const ConfigFault& fault : faults) {
    FUZZ_EXPECT(fault.where.starts_with("fuzz:"));
    FUZZ_EXPECT(!fault.message().empty());
  }
  if (!faults.empty()) return 0;
  const std::string printed = to_toml(config);
  Config again;
  read_config_text(printed, "printed", again, faults);
  FUZZ_EXPECT(faults.empty());
  FUZZ_EXPECT(again.listen == config.listen && again.clients == config.clients);
  for (const SettingInfo& setting : setting_table())
    FUZZ_EXPECT(get_setting(again, setting.name) == get_setting(config, setting.name));
  for (const marble::OptionInfo& option : marble::option_table())
    FUZZ_EXPECT(get_option(again.solver_defaults, option.name) ==
                get_option(config.solver_defaults, option.name));
  return 0;
}
