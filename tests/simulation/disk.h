// The disk under SQLite, as a file system of it (sqlite3_vfs) on top of the real one: writes that no sync has
// followed may be lost, or torn, when the power fails; and the disk may be full.
#pragma once

#include <filesystem>
#include <functional>

namespace marble::simulation {

/// Makes it the file system of every database that is opened from now on. `draw` gives numbers in [0, 1).
void install_disk(std::function<double()> draw);

/// While true, writes fail as on a full disk.
void set_disk_full(bool full);

/// Copies the files of a folder as they are once the power has failed: of each file, any of the writes since
/// its last sync, whole or up to a sector.
void copy_after_power_failure(const std::filesystem::path& from, const std::filesystem::path& to);

/// Forgets the writes below a folder that no sync has followed.
void forget_writes(const std::filesystem::path& folder);

}  // namespace marble::simulation
