#ifndef TREELIGHT_TESTS_PEERS_TREELIGHT_PEER_H_
#define TREELIGHT_TESTS_PEERS_TREELIGHT_PEER_H_

#include <memory>
#include <string>

#include "core/builder.h"
#include "tests/peers/peer.h"

namespace treelight {

/// Treelight itself.
/// @param builder  used by one peer at a time
std::unique_ptr<Peer> MakeTreelight(std::string name, std::shared_ptr<Builder> builder,
                                    const BuildOptions& options);

}  // namespace treelight

#endif  // TREELIGHT_TESTS_PEERS_TREELIGHT_PEER_H_
