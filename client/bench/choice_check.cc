#include "client/bench/choice_check.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <iterator>
#include <limits>
#include <memory>
#include <span>
#include <utility>

#include "client/bench/judge.h"
#include "client/bench/mean_radius.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::array<std::uint32_t, 4> kKs = {0, 8, 50, 100};

double Median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string NameOf(BuilderKind builder, std::uint32_t max_leaf_size) {
  return fmt::format("{} {}", BuilderName({.builder = builder}), max_leaf_size);
}

/// One tree, as it was measured.
struct Measured {
  BuildOptions options;
  std::unique_ptr<Gatherer> map;
  std::vector<double> build_ms;
  std::array<std::vector<double>, kKs.size()> gather_us;  // of one gather
};

/// One set of photons with all trees over it.
class ChoiceCell {
 public:
  ChoiceCell(Builder& builder, PointSet set, std::uint64_t photons, std::uint64_t queries,
             std::uint32_t seed)
      : builder_(builder), workload_(MakeWorkload(set, photons, queries, seed)) {
    photons_.positions = workload_.positions;
    for (const TreeCandidate& candidate : kTreeCandidates) {
      for (const MortonBits bits : {MortonBits::k30, MortonBits::k63}) {
        measured_.push_back({.options = {.builder = candidate.builder,
                                         .morton_bits = bits,
                                         .max_leaf_size = candidate.max_leaf_size,
                                         .subtree_size = kCandidateSubtree},
                             .map = {},
                             .build_ms = {},
                             .gather_us = {}});
      }
    }
  }

  absl::Status Measure(std::uint32_t repetitions) {
    // The first turn is not timed.
    for (std::uint32_t turn = 0; turn <= repetitions; ++turn) {
      for (Measured& tree : measured_) {
        if (auto status = Take(tree, turn > 0); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  const Photons& photons() const { return photons_; }
  std::vector<Measured>& measured() { return measured_; }

 private:
  absl::Status Take(Measured& tree, bool timed) {
    tree.map.reset();
    const auto begun = std::chrono::steady_clock::now();
    auto map = builder_.Build(photons_, tree.options);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
    if (!map.ok()) return map.status();
    tree.map = *std::move(map);
    if (timed) tree.build_ms.push_back(took.count());
    if (r1_ == 0) {
      const auto radius = FindMeanRadius(*tree.map, workload_.queries);
      if (!radius.ok()) return radius.status();
      r1_ = radius->radius;
    }
    for (std::size_t i = 0; i < kKs.size(); ++i) {
      const GatherOptions search = SearchOf(kKs[i]);
      const auto found = tree.map->Gather({.positions = workload_.queries}, search);
      if (!found.ok()) return found.status();
      if (timed) {
        tree.gather_us[i].push_back(found->times.kernel_us /
                                    static_cast<double>(workload_.queries.size() / 3));
      }
      const std::string wrong = WhatIsWrong(search, *found);
      if (!wrong.empty()) {
        return absl::InternalError(
            fmt::format("{}: {}", NameOf(tree.options.builder, tree.options.max_leaf_size), wrong));
      }
    }
    return absl::OkStatus();
  }

  GatherOptions SearchOf(std::uint32_t k) const {
    if (k == 0) return {.k = 0, .radius = r1_, .outputs = kOutputCount};
    return {.k = k, .outputs = kOutputCount | kOutputNeighbors};
  }

  std::string WhatIsWrong(const GatherOptions& search, const GatherResult& found) {
    const std::vector<std::size_t> places = SpreadPlaces(workload_.queries.size() / 3);
    if (judge_ == nullptr) {
      std::vector<float> checked;
      for (const std::size_t place : places) {
        const auto query = std::span(workload_.queries).subspan(3 * place, 3);
        checked.insert(checked.end(), query.begin(), query.end());
      }
      judge_ = std::make_unique<Judge>(photons_, std::move(checked), kKs.back(), r1_);
    }
    return judge_->WhatIsWrong(search, found, places);
  }

  Builder& builder_;
  const Workload workload_;
  Photons photons_;
  float r1_ = 0;
  std::unique_ptr<Judge> judge_;
  std::vector<Measured> measured_;
};

}  // namespace

absl::Status CheckChoices(Builder& builder, const ChoicePlan& plan,
                          const std::function<absl::Status(const ChoiceRow&)>& take,
                          const std::function<void(const std::string&)>& progress) {
  BuildChooser chooser(builder);
  for (const std::uint32_t seed : plan.seeds) {
    for (const PointSet set : plan.sets) {
      for (const std::uint64_t photons : plan.photons) {
        progress(
            fmt::format("choices: {}, seed {}, {} photons", treelight::NameOf(set), seed, photons));
        ChoiceCell cell(builder, set, photons, plan.queries, seed);
        if (auto status = cell.Measure(plan.repetitions); !status.ok()) return status;
        for (std::size_t i = 0; i < kKs.size(); ++i) {
          for (double gathers = 1e3; gathers < 2e9; gathers *= 10) {
            const AutoBuild asked{.expected_gathers = static_cast<std::uint64_t>(gathers),
                                  .expected_k = kKs[i]};
            const auto choice = chooser.Choose(cell.photons(), asked, {});
            if (!choice.ok()) return choice.status();
            ChoiceRow row{.set = treelight::NameOf(set),
                          .seed = seed,
                          .photons = photons,
                          .k = kKs[i],
                          .gathers = gathers,
                          .chosen = {},
                          .best = {},
                          .best_ms = std::numeric_limits<double>::infinity()};
            for (Measured& tree : cell.measured()) {
              const double ms = Median(tree.build_ms) + gathers * Median(tree.gather_us[i]) / 1e3;
              const auto& [options, chosen] = std::pair(tree.options, choice->options);
              const std::string name =
                  fmt::format("{} {}", NameOf(options.builder, options.max_leaf_size),
                              static_cast<std::uint32_t>(options.morton_bits));
              if (options.builder == chosen.builder &&
                  options.max_leaf_size == chosen.max_leaf_size &&
                  options.morton_bits == chosen.morton_bits) {
                row.chosen = name;
                row.chosen_ms = ms;
              }
              if (ms < row.best_ms) {
                row.best = name;
                row.best_ms = ms;
              }
            }
            if (auto status = take(row); !status.ok()) return status;
          }
        }
      }
    }
  }
  return absl::OkStatus();
}

std::string ChoiceCsvHeader() {
  return "set,seed,photons,k,gathers,chosen,chosen_ms,best,best_ms,ratio\n";
}

std::string ChoiceCsvLine(const ChoiceRow& row) {
  return fmt::format("{},{},{},{},{:g},{},{:.6g},{},{:.6g},{:.4f}\n", row.set, row.seed,
                     row.photons, row.k, row.gathers, row.chosen, row.chosen_ms, row.best,
                     row.best_ms, row.ratio());
}

std::string ChoiceTable(const std::vector<ChoiceRow>& rows) {
  Table table{.head = {"set", "seed", "photons", "median of auto / best", "worst", "there", "k",
                       "chosen", "best"},
              .rows = {}};
  for (auto first = rows.begin(); first != rows.end();) {
    const auto last = std::find_if(first, rows.end(), [&](const ChoiceRow& row) {
      return row.set != first->set || row.seed != first->seed || row.photons != first->photons;
    });
    std::vector<double> ratios;
    std::transform(first, last, std::back_inserter(ratios),
                   [](const ChoiceRow& row) { return row.ratio(); });
    const auto worst = std::max_element(
        first, last, [](const ChoiceRow& a, const ChoiceRow& b) { return a.ratio() < b.ratio(); });
    table.rows.push_back({first->set, std::to_string(first->seed), std::to_string(first->photons),
                          fmt::format("{:.3f}", Median(ratios)),
                          fmt::format("{:.3f}", worst->ratio()),
                          fmt::format("{:g} gathers", worst->gathers), std::to_string(worst->k),
                          worst->chosen, worst->best});
    first = last;
  }
  return Format(table);
}

}  // namespace treelight::client
