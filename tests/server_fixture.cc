#include "tests/server_fixture.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "core/model/octahedral.h"

namespace treelight::testing {

std::vector<float> MakePoints(std::size_t count, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<float> points(3 * count);
  for (float& coordinate : points) coordinate = uniform(engine);
  return points;
}

Photons MakePhotons(std::size_t count, std::uint32_t seed) {
  Photons photons;
  photons.positions = MakePoints(count, seed);
  photons.powers = MakePoints(count, seed + 1);
  for (std::size_t i = 0; i < count; ++i) {
    for (const std::int16_t number : EncodeOctahedral({0, 0, i % 2 == 0 ? 1.0f : -1.0f})) {
      photons.directions.push_back(number);
    }
  }
  return photons;
}

DeviceInfo MakeCpu() {
  DeviceInfo cpu;
  cpu.type = "cpu";
  cpu.memory_bytes = cpu.max_buffer_bytes = std::uint64_t{1} << 40;
  return cpu;
}

std::vector<v1::BuildPhotonMapRequest> MakeUpload(const std::string& name, const Photons& photons,
                                                  std::size_t photons_per_chunk) {
  std::vector<v1::BuildPhotonMapRequest> messages(1);
  v1::BuildHeader& header = *messages[0].mutable_header();
  header.set_name(name);
  header.set_photon_count(photons.size());
  header.set_has_powers(!photons.powers.empty());
  header.set_has_directions(!photons.directions.empty());
  const auto slice = [](const auto& array, std::size_t per_photon, std::size_t first,
                        std::size_t last) {
    if (array.empty()) return std::string();
    return Bytes(
        std::vector(array.begin() + per_photon * first, array.begin() + per_photon * last));
  };
  for (std::size_t first = 0; first < photons.size(); first += photons_per_chunk) {
    const std::size_t last = std::min(first + photons_per_chunk, photons.size());
    v1::PhotonChunk& chunk = *messages.emplace_back().mutable_chunk();
    chunk.set_positions(slice(photons.positions, 3, first, last));
    chunk.set_powers(slice(photons.powers, 3, first, last));
    chunk.set_directions(slice(photons.directions, 2, first, last));
  }
  return messages;
}

v1::GatherRequest MakeBatch(const std::string& name, const std::vector<float>& positions,
                            const GatherOptions& options) {
  v1::GatherRequest request;
  request.set_map(name);
  request.set_positions(Bytes(positions));
  request.set_k(options.k);
  request.set_radius(options.radius);
  request.set_outputs(options.outputs);
  return request;
}

grpc::Status Build(v1::PhotonMapService::Stub& stub,
                   std::span<const v1::BuildPhotonMapRequest> messages,
                   v1::BuildPhotonMapResponse& response) {
  grpc::ClientContext context;
  const auto writer = stub.BuildPhotonMap(&context, &response);
  for (const auto& message : messages) {
    if (!writer->Write(message)) break;  // the server has ended the call: Finish tells why
  }
  writer->WritesDone();
  return writer->Finish();
}

grpc::Status Stream(v1::PhotonMapService::Stub& stub, std::span<const v1::GatherRequest> batches,
                    std::vector<v1::GatherResponse>& parts) {
  grpc::ClientContext context;
  const auto stream = stub.GatherStream(&context);
  std::jthread sender([&] {
    for (const auto& batch : batches) {
      if (!stream->Write(batch)) break;
    }
    stream->WritesDone();
  });
  v1::GatherResponse part;
  while (stream->Read(&part)) parts.push_back(part);
  sender.join();
  return stream->Finish();
}

ServerTest::ServerTest() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = test->name();
  std::ranges::replace(name, '/', '_');  // of a parameter
  options_.listen = "";
  options_.log_file = std::filesystem::temp_directory_path() /
                      ("treelight_" + std::to_string(getpid()) + "_" + name);
}

ServerTest::~ServerTest() {
  stub_.reset();
  server_.reset();
  std::filesystem::remove(options_.log_file);
}

void ServerTest::Start(std::unique_ptr<Builder> builder) {
  auto server = server::Server::Start(options_, std::move(builder));
  ASSERT_TRUE(server.ok()) << server.status();
  server_ = *std::move(server);
  stub_ = v1::PhotonMapService::NewStub(server_->InProcessChannel());
}

v1::PhotonMap ServerTest::MustBuild(const std::string& name, const Photons& photons) {
  v1::BuildPhotonMapResponse response;
  const grpc::Status status = Build(*stub_, MakeUpload(name, photons), response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.map();
}

void ServerTest::MustRebuild(const std::string& name, const std::string& new_name) {
  grpc::ClientContext context;
  v1::RebuildPhotonMapRequest request;
  request.set_name(name);
  request.set_new_name(new_name);
  v1::BuildPhotonMapResponse response;
  const grpc::Status status = stub_->RebuildPhotonMap(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

std::vector<std::string> ServerTest::EndAndReadLog() {
  stub_.reset();
  server_.reset();
  std::vector<std::string> lines;
  std::ifstream file(options_.log_file);
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

GatherResult ServerTest::Expected(const Photons& photons, const std::vector<float>& positions,
                                  const GatherOptions& options) {
  const auto map = MakeBruteForceBuilder()->Build(photons, {});
  EXPECT_TRUE(map.ok()) << map.status();
  const auto result = (*map)->Gather({positions, {}, {}}, options);
  EXPECT_TRUE(result.ok()) << result.status();
  return *result;
}

}  // namespace treelight::testing
