#ifndef TREELIGHT_TESTS_TEST_SCENES_H_
#define TREELIGHT_TESTS_TEST_SCENES_H_

#include "client/scenes/scene.h"
#include "client/trace/intersector.h"

namespace treelight::testing {

/// The closed cube [0, 1]^3 seen from within: every wall is `wall`, its front inside. 6 units^2.
client::Scene MakeClosedBox(const client::Material& wall);

/// A closed cube whose walls emit `emission` and reflect `albedo`: a furnace. However it is
/// furnished with lossless mirrors and glass, the radiance is emission / (1 - albedo) everywhere
/// and in every direction.
client::Scene MakeFurnace(float albedo, float emission);

/// A closed grey cube with a lamp in its ceiling: light that is direct or diffusely reflected,
/// nothing else.
client::Scene MakeDiffuseBox();

/// A square lamp at (0, 1, 0) that faces down with `radiance`, `side` wide, and a white floor of 20
/// x 20 units below it at y = 0.
client::Scene MakeLampOverFloor(float radiance, float side);

/// The lamp turned up, below a mirror of 100 x 100 units at y = 2 that takes nothing away: the
/// floor sees the image of the lamp at (0, 3, 0). The camera looks at (1.5, 0, 0).
client::Scene MakeLampUnderMirror(float radiance, float side);

/// The scene on Embree; it must be valid.
client::Intersector MustIntersect(client::Scene scene);

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_TEST_SCENES_H_
