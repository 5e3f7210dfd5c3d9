#include "client/photon_spool.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <vector>

namespace treelight::client {
namespace {

constexpr std::size_t kPhotonsPerBlock = 1 << 15;

struct Record {
  std::array<float, 3> position, power;
  std::array<std::int16_t, 2> direction;
};
static_assert(sizeof(Record) == 28);

absl::Status Error() { return absl::ErrnoToStatus(errno, "temporary file of photons"); }

}  // namespace

absl::StatusOr<PhotonSpool> PhotonSpool::Create() {
  PhotonSpool spool;
  spool.file_.reset(std::tmpfile());
  if (spool.file_ == nullptr) return Error();
  return spool;
}

absl::Status PhotonSpool::Append(const Photons& photons) {
  assert(photons.powers.size() == 3 * photons.size());
  assert(photons.directions.size() == 2 * photons.size());
  std::vector<Record> records(photons.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    std::copy_n(&photons.positions[3 * i], 3, records[i].position.begin());
    std::copy_n(&photons.powers[3 * i], 3, records[i].power.begin());
    std::copy_n(&photons.directions[2 * i], 2, records[i].direction.begin());
  }
  if (std::fwrite(records.data(), sizeof(Record), records.size(), file_.get()) != records.size())
    return Error();
  size_ += records.size();
  return absl::OkStatus();
}

absl::Status PhotonSpool::Read(const std::function<absl::Status(Photons& block)>& use) {
  if (std::fflush(file_.get()) != 0) return Error();
  std::rewind(file_.get());
  std::vector<Record> records;
  for (std::uint64_t done = 0; done < size_; done += records.size()) {
    records.resize(std::min<std::uint64_t>(kPhotonsPerBlock, size_ - done));
    if (std::fread(records.data(), sizeof(Record), records.size(), file_.get()) != records.size())
      return Error();
    Photons block;
    for (const Record& record : records) {
      block.positions.insert(block.positions.end(), record.position.begin(), record.position.end());
      block.powers.insert(block.powers.end(), record.power.begin(), record.power.end());
      block.directions.insert(block.directions.end(), record.direction.begin(),
                              record.direction.end());
    }
    if (const auto status = use(block); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace treelight::client
