#include "client/commands/render_options.h"

#include <algorithm>
#include <limits>
#include <map>

#include "client/commands/check.h"
#include "client/render/gather_radius.h"
#include "client/render/image_file.h"
#include "client/render/progressive_renderer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

const std::map<std::string, DensityKernel> kKernelNames = {
    {"constant", DensityKernel::kConstant},
    {"cone", DensityKernel::kCone},
    {"epanechnikov", DensityKernel::kEpanechnikov}};

std::string CheckImagePath(const std::string& path) {
  return IsImagePath(path) ? "" : path + " ends neither in .png nor in .exr";
}

constexpr char kAuto[] = "auto";
constexpr std::uint64_t kMaxPhotonCount = 1'000'000'000;

CLI::Validator CountOrAuto() {
  return {[](const std::string& text) {
            if (text == kAuto) return std::string();
            const CLI::Range range(std::uint64_t{0}, kMaxPhotonCount);
            std::string number = text;
            return text.find_first_not_of("0123456789") == std::string::npos
                       ? range(number)
                       : text + " is neither a count nor auto";
          },
          "0 to 1e9, or auto"};
}

void AddEstimateOptions(CLI::App& command, const std::string& prefix, const std::string& what,
                        double radius_quantile, EstimateOptions& estimate,
                        std::optional<float>& radius) {
  command
      .add_option("--" + prefix + "k", estimate.k,
                  "Photons at most in an estimate of " + what + "; 0: all within the radius")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMaxNeighbors));
  command
      .add_option(
          "--" + prefix + "radius", radius,
          fmt::format("Its largest radius, scene units (default: within which {:.0f} % of the "
                      "photons of the map have their k nearest; with k 0, their {} nearest)",
                      100 * radius_quantile, estimate.k))
      ->check(NumberIn(1e-6, 1e6));
  command
      .add_option_function<std::string>(
          "--" + prefix + "kernel",
          [&estimate](const std::string& name) { estimate.kernel = kKernelNames.at(name); },
          "Its weight of a photon by distance")
      ->default_str("epanechnikov")
      ->check(CLI::IsMember(kKernelNames));
}

void AddPictureOptions(CLI::App& command, RenderChoice& choice) {
  command.add_option("--width", choice.render.width, "Pixels")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 14));
  command.add_option("--height", choice.render.height, "Pixels")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 14));
  command
      .add_option("--spp", choice.samples_per_pixel,
                  fmt::format("Samples per pixel (default: {}; {} with --reference; 1 in each pass "
                              "with --progressive)",
                              choice.render.camera.samples_per_pixel, kReferenceSamples))
      ->check(CLI::Range(1, 1 << 20));
  command.add_option("--seed", choice.seed, "Of all random numbers")
      ->capture_default_str()
      ->check(WithoutSign());
}

void AddOutputOptions(CLI::App& command, RenderChoice& choice) {
  command
      .add_option("--output", choice.output_paths,
                  "Picture, .png (sRGB) or .exr (linear); may be given more than once")
      ->default_str("SCENE.png")
      ->check(CheckImagePath);
  command.add_option("--exposure", choice.exposure, "Of PNGs, stops (default: the scene's)")
      ->check(NumberIn(-100, 100));
  command.add_flag(
      "--layers", choice.layers,
      "EXRs also get albedo.R, G, B and normal.X, Y, Z of the first surface that is no "
      "mirror, glass or pane");
  command
      .add_option("--preview", choice.preview_path,
                  "The picture as it is so far, .png or .exr, rewritten while it is rendered")
      ->check(CheckImagePath);
  command.add_option("--preview-every", choice.preview_interval_s, "Seconds between two of them")
      ->capture_default_str()
      ->check(NumberIn(0, 1e6));
  command.add_option("--compare", choice.compare_path,
                     "EXR of the same size, to tell the error against");
}

void AddReferenceOptions(CLI::App& command, RenderChoice& choice) {
  auto* const reference =
      command.add_flag("--reference", choice.reference, "Path-trace instead: needs no server");
  command
      .add_option("--noise", choice.target_noise,
                  "With --reference: end before --spp when the noise (standard error of a channel "
                  "of a pixel, root mean square) is no more than this")
      ->needs(reference)
      ->check(NumberIn(0, 1e6));
  command
      .add_flag("--allow-incomplete", choice.allow_incomplete,
                "With --reference: leave out light of point lights by way of mirrors and glass, "
                "which cannot be path-traced, rather than refuse the scene")
      ->needs(reference);
}

void AddProgressiveOptions(CLI::App& command, RenderChoice& choice) {
  command
      .add_flag("--progressive", choice.progressive,
                "Render in passes, each of fresh photons (--photons, --caustic-photons) and "
                "fresh camera rays, with radii that shrink: the mean goes to the true picture")
      ->excludes("--reference");
  command
      .add_option("--passes", choice.passes,
                  fmt::format("With --progressive: end after so many (default: {} where neither "
                              "--target-error nor --time-limit is given)",
                              kProgressivePasses))
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000}));
  command
      .add_option("--target-error", choice.target_error,
                  fmt::format("With --progressive: end when the estimated error (root of the "
                              "relative mean squared error, noise and blur) is no more than this "
                              "(default: none; {} with --photons auto)",
                              kAutoTargetError))
      ->check(NumberIn(1e-6, 1e6));
  command
      .add_option("--time-limit", choice.time_limit_s,
                  "With --progressive: end within so many seconds, or with the first pass")
      ->check(NumberIn(0, 1e9));
  command
      .add_option("--error-curve", choice.error_curve_folder,
                  "With --progressive: folder for progressive.csv, the estimated error after each "
                  "pass, with --compare also the measured one, and its chart")
      ->type_name("FOLDER");
}

/// A reference has no photon maps: their options beside it are errors, not passed over.
void RefuseWithReference(CLI::App& command) {
  for (const char* name : {"--photons", "--caustic-photons", "--k", "--radius", "--kernel",
                           "--caustic-k", "--caustic-radius", "--caustic-kernel", "--final-gather",
                           "--max-relative-error", "--map-name", "--keep-map"}) {
    command.get_option(name)->excludes("--reference");
  }
}

void AddPhotonOptions(CLI::App& command, RenderChoice& choice) {
  command
      .add_option_function<std::string>(
          "--photons",
          [&choice](const std::string& count) {
            choice.auto_photons = count == kAuto;
            if (!choice.auto_photons) choice.photon_count = std::stoull(count);
          },
          "Photons of the indirect map; 0: none. auto: as many as --target-error takes, in passes "
          "(--progressive) that a pilot plans")
      ->default_str(fmt::to_string(choice.photon_count))
      ->type_name("COUNT")
      ->check(CountOrAuto());
  command
      .add_option("--caustic-photons", choice.caustic_photon_count,
                  "Photons of the caustic map, where there is something specular; 0: none. With "
                  "--photons auto there is one for five of the others, or none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, kMaxPhotonCount));
  AddEstimateOptions(command, "", "indirect light", kIndirectRadiusQuantile, choice.render.indirect,
                     choice.radii.indirect);
  command.get_option("--k")->each([&choice](const std::string&) { choice.gives_k = true; });
  AddEstimateOptions(command, "caustic-", "caustics", kCausticRadiusQuantile, choice.render.caustic,
                     choice.radii.caustic);
  command
      .add_option("--final-gather", choice.render.camera.final_gather_rays,
                  "Rays from each diffuse hit to look indirect light up where they end; 0: it is "
                  "looked up at the hit itself")
      ->capture_default_str()
      ->check(CLI::Range(0u, 4096u));
  command
      .add_option("--max-relative-error", choice.max_relative_error,
                  "Gather from merged photons where they keep densities within this error, root "
                  "mean square of each message; 0: exactly")
      ->capture_default_str()
      ->check(NumberIn(0, 0.999));
  command
      .add_option("--map-name", choice.map_name,
                  "The maps are NAME.indirect and NAME.caustic (default: the scene's name)")
      ->check(ServerName());
  command.add_flag(
      "--keep-map", choice.keep_maps,
      fmt::format("Leave the maps on the server; else they are deleted at the end, and "
                  "by the server after {} h where that fails",
                  kTimeToLive.count()));
}

/// Options of passes without --progressive, and what --photons auto chooses itself.
void CheckPasses(RenderChoice& choice) {
  const auto refuse = [](bool given, const char* option, const char* why) {
    if (given) throw CLI::ValidationError(option, why);
  };
  if (choice.auto_photons) {
    constexpr char kChosen[] = "is chosen by --photons auto";
    refuse(choice.radii.indirect.has_value(), "--radius", kChosen);
    refuse(choice.radii.caustic.has_value(), "--caustic-radius", kChosen);
    refuse(choice.render.indirect.k == 0, "--k", "is 0: --photons auto needs a k");
    refuse(choice.render.caustic.k == 0, "--caustic-k", "is 0: --photons auto needs a k");
    choice.progressive = true;
    if (choice.target_error == 0) choice.target_error = kAutoTargetError;
  }
  constexpr char kNeeds[] = "requires --progressive or --photons auto";
  refuse(choice.progressive && choice.keep_maps, "--keep-map",
         "excludes --progressive and --photons auto");
  refuse(choice.progressive && choice.max_relative_error > 0, "--max-relative-error",
         "excludes --progressive and --photons auto, whose maps live for one pass");
  if (choice.progressive) return;
  refuse(choice.passes.has_value(), "--passes", kNeeds);
  refuse(choice.target_error > 0, "--target-error", kNeeds);
  refuse(choice.time_limit_s.has_value(), "--time-limit", kNeeds);
  refuse(!choice.error_curve_folder.empty(), "--error-curve", kNeeds);
}

void CheckProgressiveK(const std::string& name, std::uint32_t k) {
  if (k == 0 || k >= kMinProgressiveNeighbors) return;
  throw CLI::ValidationError(
      name, fmt::format("{} is under {}, from where on it can shrink with --progressive", k,
                        kMinProgressiveNeighbors));
}

}  // namespace

PhotonRenderOptions RenderChoice::photon_options(const GatherRadii& chosen) const {
  PhotonRenderOptions options = render;
  options.camera.samples_per_pixel = samples_per_pixel.value_or(options.camera.samples_per_pixel);
  options.camera.seed = seed;
  for (EstimateOptions* const estimate : {&options.indirect, &options.caustic}) {
    estimate->approximation.max_relative_error = max_relative_error;
  }
  if (chosen.caustic) options.caustic.radius = *chosen.caustic;
  if (chosen.indirect) {
    options.indirect.radius = *chosen.indirect;
    // Where photons are gathered from, the estimate is blurred by its radius: corners need their
    // light from further away.
    options.camera.final_gather_min_distance = options.indirect.radius;
  }
  return options;
}

std::uint64_t RenderChoice::max_passes() const {
  if (passes) return *passes;
  return target_error > 0 || time_limit_s ? std::numeric_limits<std::uint64_t>::max()
                                          : kProgressivePasses;
}

PathTraceOptions RenderChoice::reference_options() const {
  return {.width = render.width,
          .height = render.height,
          .samples_per_pixel = samples_per_pixel.value_or(kReferenceSamples),
          .seed = seed,
          .target_noise = target_noise};
}

void AddRenderOptions(CLI::App& command, RenderChoice& choice) {
  AddSceneOptions(command, choice.scene);
  AddPictureOptions(command, choice);
  AddOutputOptions(command, choice);
  AddReferenceOptions(command, choice);
  AddPhotonOptions(command, choice);
  AddProgressiveOptions(command, choice);
  RefuseWithReference(command);
}

void CheckRenderOptions(RenderChoice& choice) {
  if (choice.reference && choice.samples_per_pixel == 1u) {
    throw CLI::ValidationError("--spp", "a reference needs at least 2, to tell its noise");
  }
  CheckPasses(choice);
  if (choice.progressive) {
    CheckProgressiveK("--k", choice.render.indirect.k);
    CheckProgressiveK("--caustic-k", choice.render.caustic.k);
  }
  auto& paths = choice.output_paths;
  if (paths.empty()) paths = {SceneName(choice.scene.scene) + ".png"};
  for (auto path = paths.begin(); path != paths.end(); ++path) {
    if (std::find(paths.begin(), path, *path) != path)
      throw CLI::ValidationError("--output", *path + " is given twice");
  }
  if (std::ranges::find(paths, choice.preview_path) != paths.end())
    throw CLI::ValidationError("--preview", choice.preview_path + " is an --output too");
  if (choice.layers && !std::ranges::any_of(paths, IsExrPath))
    throw CLI::ValidationError("--layers", "needs an --output that ends in .exr");
}

}  // namespace treelight::client
