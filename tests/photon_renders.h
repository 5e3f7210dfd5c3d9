#ifndef TREELIGHT_TESTS_PHOTON_RENDERS_H_
#define TREELIGHT_TESTS_PHOTON_RENDERS_H_

#include <cstdint>
#include <optional>
#include <utility>

#include "client/render/map_upload.h"
#include "client/render/photon_renderer.h"
#include "client/trace/photon_tracer.h"
#include "gtest/gtest.h"
#include "tests/server_fixture.h"

namespace treelight::testing {

/// Pictures by way of a whole server, in process, on the brute-force builder.
class PhotonRenders : public ServerTest {
 protected:
  void SetUp() override {
    Start();
    ASSERT_NE(server_, nullptr);
    client_.emplace(server_->InProcessChannel());
  }
  void TearDown() override { client_.reset(); }

  client::UploadedMaps MustUpload(const client::Intersector& scene, std::uint64_t photon_count,
                                  std::uint64_t seed = 11) {
    const auto photons = client::TracePhotons(
        scene,
        {.indirect_photons = photon_count, .caustic_photons = photon_count / 4, .seed = seed});
    EXPECT_TRUE(photons.ok()) << photons.status();
    auto maps = client::UploadMaps(*client_, *photons, {.name = "test"});
    EXPECT_TRUE(maps.ok()) << maps.status();
    return *std::move(maps);
  }

  client::PhotonRenderedImage MustRender(const client::Intersector& scene,
                                         const client::PhotonMaps& maps,
                                         const client::PhotonRenderOptions& options) {
    auto render = client::RenderPhotonMaps(scene, *client_, maps, options);
    EXPECT_TRUE(render.ok()) << render.status();
    return *std::move(render);
  }

  std::optional<client::PhotonMapClient> client_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_PHOTON_RENDERS_H_
