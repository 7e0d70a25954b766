#include "disk.h"

#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <new>
#include <string>
#include <thread>
#include <vector>

namespace marble::simulation {
namespace {

constexpr std::size_t kSector = 512;
constexpr double kMeanSync_s = 0.004;

// A write since the last sync of its file.
struct Write {
  sqlite3_int64 offset = 0;
  std::string before, after;  // `before` is shorter where the file grew
};

struct Disk {
  std::function<double()> draw;
  sqlite3_vfs* real = nullptr;
  sqlite3_vfs own = {};
  bool full = false;
  std::map<std::string, std::vector<Write>> unsynced;  // by path
};
Disk& disk() {
  static Disk one;
  return one;
}

struct File {
  sqlite3_file base;
  const char* path;   // SQLite's, until it is closed; null: a temporary file
  sqlite3_file real;  // of the size that the real file system asks for
};
File& file_of(sqlite3_file* file) { return *reinterpret_cast<File*>(file); }

// Forwards method xNAME of files.
#define MARBLE_FORWARD(name, parameters, ...)                        \
  int name parameters {                                              \
    sqlite3_file* const real = &file_of(file).real;                  \
    return real->pMethods->x##name(real __VA_OPT__(, ) __VA_ARGS__); \
  }
MARBLE_FORWARD(Read, (sqlite3_file * file, void* to, int size, sqlite3_int64 at), to, size, at)
MARBLE_FORWARD(Truncate, (sqlite3_file * file, sqlite3_int64 size), size)
MARBLE_FORWARD(FileSize, (sqlite3_file * file, sqlite3_int64* size), size)
MARBLE_FORWARD(Lock, (sqlite3_file * file, int level), level)
MARBLE_FORWARD(Unlock, (sqlite3_file * file, int level), level)
MARBLE_FORWARD(CheckReservedLock, (sqlite3_file * file, int* is_locked), is_locked)
MARBLE_FORWARD(FileControl, (sqlite3_file * file, int operation, void* argument), operation, argument)
MARBLE_FORWARD(SectorSize, (sqlite3_file * file))
MARBLE_FORWARD(ShmMap, (sqlite3_file * file, int page, int size, int extend, void volatile** at), page, size,
               extend, at)
MARBLE_FORWARD(ShmLock, (sqlite3_file * file, int offset, int count, int flags), offset, count, flags)
MARBLE_FORWARD(ShmUnmap, (sqlite3_file * file, int remove), remove)
#undef MARBLE_FORWARD

// No promise on what a power failure leaves.
int DeviceCharacteristics(sqlite3_file* /*file*/) { return 0; }

void ShmBarrier(sqlite3_file* file) {
  sqlite3_file* const real = &file_of(file).real;
  real->pMethods->xShmBarrier(real);
}

int Close(sqlite3_file* file) {
  sqlite3_file* const real = &file_of(file).real;
  return real->pMethods->xClose(real);
}

int write_file(sqlite3_file* file, const void* from, int size, sqlite3_int64 at) {
  File& own = file_of(file);
  if (disk().full) return SQLITE_FULL;
  if (own.path != nullptr) {
    Write write{at, {}, std::string(static_cast<const char*>(from), static_cast<std::size_t>(size))};
    sqlite3_int64 length = 0;
    own.real.pMethods->xFileSize(&own.real, &length);
    write.before.resize(static_cast<std::size_t>(std::clamp<sqlite3_int64>(length - at, 0, size)));
    if (!write.before.empty())
      own.real.pMethods->xRead(&own.real, write.before.data(), static_cast<int>(write.before.size()), at);
    disk().unsynced[own.path].push_back(std::move(write));
  }
  return own.real.pMethods->xWrite(&own.real, from, size, at);
}

// Takes its time, in which the server may die. The real file is not synced: nothing here outlives the
// machine.
int sync_file(sqlite3_file* file, int /*flags*/) {
  const char* const path = file_of(file).path;
  std::this_thread::sleep_for(std::chrono::duration<double>(kMeanSync_s * -std::log(1.0 - disk().draw())));
  if (disk().full) return SQLITE_IOERR_FSYNC;
  if (path != nullptr) disk().unsynced.erase(path);
  return SQLITE_OK;
}

constexpr sqlite3_io_methods kMethods = {2,
                                         Close,
                                         Read,
                                         write_file,
                                         Truncate,
                                         sync_file,
                                         FileSize,
                                         Lock,
                                         Unlock,
                                         CheckReservedLock,
                                         FileControl,
                                         SectorSize,
                                         DeviceCharacteristics,
                                         ShmMap,
                                         ShmLock,
                                         ShmBarrier,
                                         ShmUnmap,
                                         nullptr,
                                         nullptr};

int open_file(sqlite3_vfs* /*own*/, const char* path, sqlite3_file* file, int flags, int* out_flags) {
  File& opened = file_of(file);
  opened.base.pMethods = nullptr;
  opened.path = path;
  const int code = disk().real->xOpen(disk().real, path, &opened.real, flags, out_flags);
  if (code == SQLITE_OK) opened.base.pMethods = &kMethods;
  return code;
}

}  // namespace

void install_disk(std::function<double()> draw) {
  Disk& one = disk();
  one.draw = std::move(draw);
  one.real = sqlite3_vfs_find(nullptr);
  one.own = *one.real;
  one.own.zName = "simulated";
  one.own.szOsFile = static_cast<int>(sizeof(File)) + one.real->szOsFile;
  one.own.xOpen = open_file;
  one.own.pNext = nullptr;
  sqlite3_vfs_register(&one.own, 1);
}

void set_disk_full(bool full) { disk().full = full; }

void copy_after_power_failure(const std::filesystem::path& from, const std::filesystem::path& to) {
  for (const auto& entry : std::filesystem::directory_iterator(from)) {
    std::ifstream in(entry.path(), std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), {});
    if (const auto writes = disk().unsynced.find(entry.path().string()); writes != disk().unsynced.end()) {
      const auto put = [&bytes](std::size_t at, std::string_view text) {
        if (bytes.size() < at + text.size()) bytes.resize(at + text.size());
        bytes.replace(at, text.size(), text);
      };
      for (auto write = writes->second.rbegin(); write != writes->second.rend(); ++write) {
        const auto at = static_cast<std::size_t>(write->offset);
        if (write->before.size() < write->after.size())
          bytes.resize(std::min(bytes.size(), at + write->before.size()));
        put(at, write->before);
      }
      for (const Write& write : writes->second) {
        const double kept = disk().draw();
        if (kept < 0.4) continue;
        std::size_t size = write.after.size();
        if (kept < 0.6) size = size / kSector / 2 * kSector;
        put(static_cast<std::size_t>(write.offset), std::string_view(write.after).substr(0, size));
      }
    }
    std::ofstream(to / entry.path().filename(), std::ios::binary) << bytes;
  }
}

void forget_writes(const std::filesystem::path& folder) {
  std::erase_if(disk().unsynced,
                [&](const auto& file) { return std::filesystem::path(file.first).parent_path() == folder; });
}

}  // namespace marble::simulation
