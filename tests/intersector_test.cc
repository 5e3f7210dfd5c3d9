#include "client/trace/intersector.h"

#include <cmath>
#include <random>

#include "client/scenes/cornell.h"
#include "client/scenes/registry.h"
#include "client/scenes/vector.h"
#include "client/trace/sampling.h"
#include "client/trace/scatter.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MustIntersect;

const Material kGrey{.name = "grey", .reflectance = {0.5f, 0.5f, 0.5f}};

TEST(Intersector, FindsBothSidesOfASphere) {
  Scene scene;
  scene.materials = {kGrey};
  scene.spheres = {{.center = {1, 2, 3}, .radius = 0.5f, .material = 0}};
  const Intersector intersector = MustIntersect(scene);
  const auto outside = intersector.Intersect({{1, 2, 0}, {0, 0, 1}});
  ASSERT_TRUE(outside);
  EXPECT_FLOAT_EQ(outside->distance, 2.5f);
  EXPECT_EQ(outside->normal, (Vec3{0, 0, -1}));
  EXPECT_TRUE(outside->front);
  EXPECT_FALSE(outside->triangle);
  const auto inside = intersector.Intersect({{1, 2, 3}, {0, 0, 1}});
  ASSERT_TRUE(inside);
  EXPECT_FLOAT_EQ(inside->distance, 0.5f);
  EXPECT_EQ(inside->normal, (Vec3{0, 0, -1}));
  EXPECT_FALSE(inside->front);
  EXPECT_FALSE(intersector.Intersect({{1, 2.6f, 0}, {0, 0, 1}}));
  EXPECT_TRUE(intersector.Occluded({1, 2, 0}, {1, 2, 6}));
  EXPECT_FALSE(intersector.Occluded({1, 2, 0}, {1, 2, 2.4f}));
}

TEST(Intersector, TellsTheFrontOfATriangle) {
  const Intersector intersector = MustIntersect(MakeClosedBox(kGrey));
  const auto inside = intersector.Intersect({{0.3f, 0.4f, 0.5f}, {0, -1, 0}});
  ASSERT_TRUE(inside);
  EXPECT_TRUE(inside->front);
  EXPECT_EQ(inside->normal, (Vec3{0, 1, 0}));
  EXPECT_NEAR(inside->position.x, 0.3f, 1e-6);
  EXPECT_NEAR(inside->position.z, 0.5f, 1e-6);
  EXPECT_EQ(inside->position.y, 0);
  const auto outside = intersector.Intersect({{0.3f, 2, 0.5f}, {0, -1, 0}});
  ASSERT_TRUE(outside);
  EXPECT_FALSE(outside->front);
  EXPECT_EQ(outside->normal, (Vec3{0, 1, 0}));
}

// At any place and size of the box, no ray meets the wall that it leaves, and none slips out
// between two walls, not even one that lands within rounding of an edge.
TEST(Intersector, AClosedBoxStaysClosed) {
  const auto seed = std::random_device{}();
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  constexpr int kRays = 20'000;
  for (const float scale : {0.01f, 1.0f, 300.0f}) {
    for (const float shift : {0.0f, 1.0f, -50.0f}) {
      Scene scene = MakeClosedBox(kGrey);
      for (Vec3& v : scene.mesh.vertices) v = scale * (v + Vec3{shift, shift, shift});
      const Intersector intersector = MustIntersect(scene);
      const float middle = scale * (0.5f + shift);
      const Ray start{{middle, middle, middle}, {0, 0, 1}};
      Ray ray = start;
      int lost = 0;
      for (int i = 0; i < kRays; ++i) {
        const auto hit = intersector.Intersect(ray);
        if (!hit || !hit->front) {
          ++lost;
          ray = start;
          continue;
        }
        const float u = uniform(engine), v = uniform(engine);
        ray = LeaveSurface(*hit, CosineDirection(hit->normal, u, v));
      }
      EXPECT_EQ(lost, 0) << "seed " << seed << " scale " << scale << " shift " << shift;
    }
  }
}

TEST(Intersector, ARayThatLeavesASphereDoesNotMeetItAgain) {
  Scene scene;
  scene.materials = {kGrey};
  scene.spheres = {{.center = {0.42f, 0.351f, 0.28f}, .radius = 0.35f, .material = 0}};
  const Intersector intersector = MustIntersect(scene);
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < 20'000; ++i) {
    const float a = uniform(engine), b = uniform(engine), c = uniform(engine), d = uniform(engine);
    const Vec3 inward = CosineDirection({0, 0, 1}, a, b);
    const auto hit = intersector.Intersect({scene.spheres[0].center - 3 * inward, inward});
    ASSERT_TRUE(hit);
    EXPECT_FALSE(intersector.Intersect(LeaveSurface(*hit, CosineDirection(hit->normal, c, d))));
    const auto exit = intersector.Intersect(LeaveSurface(*hit, inward));
    ASSERT_TRUE(exit);
    EXPECT_FALSE(exit->front);
    EXPECT_NEAR(exit->distance, 0.7f, 1e-3);
  }
}

// Rays in all directions, so that a packet holds hits on either kind of shape, misses, and lanes
// without a ray.
TEST(Intersector, APacketMeetsWhatItsRaysMeet) {
  const Intersector intersector = MustIntersect(MakeCornell());
  std::mt19937 engine(6);
  std::uniform_real_distribution<float> uniform(0, 1);
  int hits = 0, misses = 0, spheres = 0;
  for (std::size_t count = 0; count < 50 * kPacketSize; ++count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count % (kPacketSize + 1); ++i) {
      const float u = uniform(engine), v = uniform(engine);
      rays.push_back({{0, 0.8f, 1.2f}, CosineDirection({0, 0, i % 5 == 0 ? 1.0f : -1.0f}, u, v)});
    }
    const auto packet = intersector.IntersectPacket(rays);
    for (std::size_t i = 0; i < kPacketSize; ++i) {
      const auto hit = i < rays.size() ? intersector.Intersect(rays[i]) : std::nullopt;
      ASSERT_EQ(packet[i].has_value(), hit.has_value());
      if (!hit) {
        ++misses;
        continue;
      }
      ++hits;
      spheres += !hit->triangle;
      EXPECT_EQ(packet[i]->material, hit->material);
      EXPECT_EQ(packet[i]->front, hit->front);
      EXPECT_NEAR(packet[i]->distance, hit->distance, 1e-5f);
      EXPECT_LT(Length(packet[i]->position - hit->position), 1e-5f);
      EXPECT_LT(Length(packet[i]->normal - hit->normal), 1e-4f);
    }
  }
  EXPECT_GT(hits, 1000);
  EXPECT_GT(spheres, 100);
  EXPECT_GT(misses, 1000);
}

// On the triangle between the vertices: normals by barycentric coordinates, on the side of the ray;
// (0, 0, 0) stands for the triangle's own.
TEST(Intersector, InterpolatesNormals) {
  Scene scene;
  scene.materials = {kGrey};
  scene.mesh.vertices = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}};  // faces +y
  scene.mesh.corners = {{0, 1, 2}};
  scene.mesh.materials = {0};
  scene.mesh.normals = {{0, 0, 0}, {0, 0.6f, 0.8f}, {0.6f, 0.8f, 0}};
  for (const bool flipped : {false, true}) {  // some files have them on the other side
    if (flipped) {
      for (Vec3& normal : scene.mesh.normals) normal = -normal;
    }
    const Intersector intersector = MustIntersect(scene);
    for (const float side : {1.0f, -1.0f}) {
      const auto hit = intersector.Intersect({{0.25f, side, 0.5f}, {0, -side, 0}});
      ASSERT_TRUE(hit);
      EXPECT_EQ(hit->normal, (Vec3{0, side, 0}));
      // The vertices weigh 1/4, 1/2 and 1/4.
      const Vec3 expected = Normalize(Vec3{0.15f, 0.25f + 0.3f + 0.2f, 0.4f});
      EXPECT_LT(Length(hit->shading_normal - side * expected), 1e-5f);
    }
  }
}

TEST(Intersector, PanesLetTheirShareOfLightPass) {
  Scene scene = MakeClosedBox(kGrey);
  scene.materials.push_back({.name = "sheet",
                             .surface = Surface::kPane,
                             .reflectance = {},
                             .ior = 1.5f,
                             .transmittance = {1, 0.5f, 0}});
  for (const float y : {0.4f, 0.6f})
    AddQuad({0, y, 1}, {1, y, 1}, {1, y, 0}, {0, y, 0}, 1, scene.mesh);
  const Intersector intersector = MustIntersect(scene);
  const Rgb one = SplitAtPane(1, 1.5f, {1, 0.5f, 0}).passed;
  const Rgb both = intersector.Transmittance({0.3f, 0.1f, 0.3f}, {0.3f, 0.9f, 0.3f});
  EXPECT_NEAR(both.r, one.r * one.r, 1e-6);
  EXPECT_NEAR(both.g, one.g * one.g, 1e-6);
  EXPECT_EQ(both.b, 0);
  EXPECT_NEAR(intersector.Transmittance({0.3f, 0.1f, 0.3f}, {0.3f, 0.5f, 0.3f}).r, one.r, 1e-6);
  EXPECT_EQ(intersector.Transmittance({0.3f, 0.1f, 0.3f}, {0.3f, 0.3f, 0.3f}), (Rgb{1, 1, 1}));
  EXPECT_EQ(intersector.Transmittance({0.3f, 0.1f, 0.3f}, {0.3f, 1.5f, 0.3f}), Rgb{});
  EXPECT_TRUE(intersector.Occluded({0.3f, 0.1f, 0.3f}, {0.3f, 0.5f, 0.3f}));
}

// Segments between the halves of a room that a pane, a sphere and nothing part; lanes without a
// segment stay out of it.
TEST(Intersector, APacketOfSegmentsPassesWhatEachPasses) {
  for (const bool panes : {false, true}) {
    Scene scene = MakeClosedBox(kGrey);
    scene.spheres = {{.center = {0.3f, 0.5f, 0.3f}, .radius = 0.25f, .material = 0}};
    if (panes) {
      scene.materials.push_back({.name = "sheet",
                                 .surface = Surface::kPane,
                                 .reflectance = {},
                                 .ior = 1.5f,
                                 .transmittance = {1, 0.5f, 0}});
      AddQuad({0.5f, 0.5f, 1}, {1, 0.5f, 1}, {1, 0.5f, 0}, {0.5f, 0.5f, 0}, 1, scene.mesh);
    }
    const Intersector intersector = MustIntersect(scene);
    std::mt19937 engine(7);
    std::uniform_real_distribution<float> place(0.05f, 0.95f);
    int blocked = 0, part = 0, clear = 0;
    for (std::size_t count = 0; count < 20 * kPacketSize; ++count) {
      std::vector<Segment> segments(count % (kPacketSize + 1));
      for (Segment& segment : segments) {
        segment = {{place(engine), 0.1f, place(engine)}, {place(engine), 0.9f, place(engine)}};
      }
      const auto packet = intersector.TransmittancePacket(segments);
      for (std::size_t i = 0; i < kPacketSize; ++i) {
        const Rgb passed = i < segments.size()
                               ? intersector.Transmittance(segments[i].from, segments[i].to)
                               : Rgb{};
        EXPECT_EQ(packet[i], passed);
        if (i < segments.size()) ++(passed.r == 0 ? blocked : passed.r == 1 ? clear : part);
      }
    }
    EXPECT_GT(blocked, 300);
    EXPECT_GT(clear, 300);
    EXPECT_EQ(part > 300, panes);
  }
}

// From outside glass always lets some light in, at 45 degrees bent to asin(sin 45 / 1.5); from
// inside it reflects all of that angle's light.
TEST(SplitAtHit, KnowsTheInsideFromTheOutside) {
  Scene scene;
  scene.materials = {
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f}};
  scene.spheres = {{.center = {0, 0, 0}, .radius = 1, .material = 0}};
  const Intersector intersector = MustIntersect(scene);
  const float half = std::sqrt(0.5f);
  const Ray in{{half, 0, -3}, {0, 0, 1}};
  const auto entry = intersector.Intersect(in);
  ASSERT_TRUE(entry);
  const DielectricSplit entered = SplitAtHit(in, *entry);
  ASSERT_TRUE(entered.refracted);
  EXPECT_NEAR(Length(Cross(*entered.refracted, entry->normal)), half / 1.5f, 1e-5);
  const Ray out{{half, 0, 0}, {0, 0, 1}};
  const auto exit = intersector.Intersect(out);
  ASSERT_TRUE(exit);
  EXPECT_FALSE(SplitAtHit(out, *exit).refracted);
}

TEST(Intersector, RefusesAnInvalidScene) {
  const auto message = [](const Scene& scene) {
    const auto status = Intersector::Create(scene).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  Scene scene = MakeClosedBox(kGrey);
  scene.mesh.corners[3][1] = 99;
  EXPECT_EQ(message(scene), "triangle 3: there is no vertex 99");
  scene = MakeClosedBox(kGrey);
  scene.mesh.materials[2] = 1;
  EXPECT_EQ(message(scene), "triangle 2: there is no material 1");
  scene = MakeClosedBox({.name = "lamp", .reflectance = {}, .emission = {1, 1, 1}});
  scene.spheres = {{.center = {}, .radius = 1, .material = 0}};
  EXPECT_EQ(message(scene), "sphere 0 emits; only triangles may");
  scene.materials[0].emission = {};
  scene.spheres[0].radius = 0;
  EXPECT_EQ(message(scene), "sphere 0: radius 0 is not positive");
  scene = MakeClosedBox(kGrey);
  scene.materials[0].emission.g = -1;
  EXPECT_EQ(message(scene),
            "material grey: emission 0 -1 0 is not a colour: each must be finite and >= 0");
  scene.materials[0] = {
      .name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 0};
  EXPECT_EQ(message(scene), "material glass: ior 0 is not positive");
  scene.materials[0] = {
      .name = "satin", .surface = Surface::kGlossy, .reflectance = {}, .exponent = NAN};
  EXPECT_EQ(message(scene), "material satin: exponent nan is not a number >= 0");
  scene = MakeClosedBox(kGrey);
  scene.mesh.normals.resize(3);
  EXPECT_EQ(message(scene), "mesh has 24 vertices but 3 normals");
  scene = MakeClosedBox(kGrey);
  scene.materials[0] = {.name = "satin",
                        .surface = Surface::kGlossy,
                        .reflectance = {0.9f, 0, 0},
                        .specular = {0.35f, 0, 0}};
  EXPECT_EQ(message(scene),
            "material satin: it gives 1.25 times the light that it gets; reflectance and specular "
            "together, and transmittance, are at most 1 in each channel");
  scene = MakeClosedBox(kGrey);
  scene.point_lights = {{.position = {}, .intensity = {1, 1, 1}, .cone_degrees = 0}};
  EXPECT_EQ(message(scene), "point light 0: cone_degrees 0 is not in (0, 180]");
  scene.point_lights[0].cone_degrees = 30;
  EXPECT_EQ(message(scene),
            "point light 0: falloff_begin_degrees 180 is not between 0 and cone_degrees, 30");
  scene.point_lights[0].falloff_begin_degrees = 30;
  scene.point_lights[0].direction = {0, -2, 0};
  EXPECT_EQ(message(scene), "point light 0: the length of its direction is 2, not 1");
}

TEST(Registry, MakesEverySceneItNames) {
  for (const std::string& name : BuiltInScenes()) {
    const auto scene = MakeScene(name);
    ASSERT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ(scene->name, name);
    EXPECT_TRUE(Intersector::Create(*scene).ok()) << name;
  }
  const std::string unknown = "there is no scene \"nowhere\"; built in: cornell";
  EXPECT_EQ(std::string(MakeScene("nowhere").status().message()).substr(0, unknown.size()),
            unknown);
}

}  // namespace
}  // namespace treelight::client
