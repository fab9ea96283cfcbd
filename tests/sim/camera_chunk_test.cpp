// Chunk data: what a frame says about itself, read by the stock client's own parser.
#include <gtest/gtest.h>

#include <cstdint>

#include "sim/camera_server.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

TEST(CameraChunks, StockParserReadsWhatWasAsked) {
  ServedRig rig(101, 1);
  ArvClient client(rig.addresses[0]);
  ArvCamera* camera = client.Camera();
  ASSERT_TRUE(arv_camera_are_chunks_available(camera, SOLE_ARV_OK));
  const guint plain = arv_camera_get_payload(camera, SOLE_ARV_OK);
  arv_camera_set_chunks(camera, "FrameID,Timestamp,ExposureTime,LineStatusAll,TriggerSequence",
                        SOLE_ARV_OK);
  EXPECT_TRUE(arv_camera_get_chunk_mode(camera, SOLE_ARV_OK));
  EXPECT_TRUE(arv_camera_get_chunk_state(camera, "ExposureTime", SOLE_ARV_OK));
  EXPECT_EQ(arv_camera_get_payload(camera, SOLE_ARV_OK), plain + 8 + 4 * 16 + 12);
  arv_camera_set_exposure_time(camera, 250.5, SOLE_ARV_OK);
  // 576 bytes a packet: chunk data shares a packet with pixels and spills over into the next.
  client.Start("Line1", 576);
  ArvChunkParser* parser = arv_camera_create_chunk_parser(camera);
  const RawClient raw;
  for (std::int64_t sequence = -1; sequence <= 3; ++sequence) {
    raw.Pulse(rig.server->BusPort(), {.sequence = sequence, .scheduled_ns = 1000 + sequence});
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(client.Stream(), 5000000);
    ASSERT_NE(buffer, nullptr);
    ASSERT_EQ(arv_buffer_get_status(buffer), ARV_BUFFER_STATUS_SUCCESS);
    EXPECT_TRUE(arv_buffer_has_chunks(buffer));
    const auto integer = [&](const char* name) {
      return arv_chunk_parser_get_integer_value(parser, buffer, name, SOLE_ARV_OK);
    };
    EXPECT_EQ(integer("ChunkFrameID"), sequence + 2);
    EXPECT_EQ(integer("ChunkTimestamp"), 1000 + sequence);
    EXPECT_EQ(integer("ChunkTriggerSequence"), sequence);
    EXPECT_EQ(integer("ChunkLineStatusAll"), 2) << "Line2: exposure active";
    EXPECT_EQ(arv_chunk_parser_get_float_value(parser, buffer, "ChunkExposureTime", SOLE_ARV_OK),
              250.5);
    std::size_t size = 0;
    const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, &size));
    const ImageU8& expected = rig.frames.At(0, {.sequence = sequence});
    ASSERT_EQ(size, expected.pixels.size() + 8 + 4 * 16 + 12);
    EXPECT_TRUE(std::equal(expected.pixels.begin(), expected.pixels.end(), data));
    EXPECT_EQ(arv_buffer_get_image_width(buffer), kWidth);
    arv_stream_push_buffer(client.Stream(), buffer);
  }
  g_object_unref(parser);
}

TEST(CameraChunks, OnlyEnabledChunksAreSentAndNoneWithoutChunkMode) {
  const ServedRig rig(102, 1);
  ArvClient client(rig.addresses[0]);
  ArvCamera* camera = client.Camera();
  const guint plain = arv_camera_get_payload(camera, SOLE_ARV_OK);
  arv_camera_set_chunks(camera, "TriggerSequence", SOLE_ARV_OK);
  arv_camera_set_region(camera, 0, 0, kWidth, 100, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_get_payload(camera, SOLE_ARV_OK), kWidth * 100U + 8 + 16);
  client.Start("Software");
  ArvChunkParser* parser = arv_camera_create_chunk_parser(camera);
  arv_camera_software_trigger(camera, SOLE_ARV_OK);
  ArvBuffer* buffer = arv_stream_timeout_pop_buffer(client.Stream(), 5000000);
  ASSERT_NE(buffer, nullptr);
  EXPECT_EQ(arv_chunk_parser_get_integer_value(parser, buffer, "ChunkTriggerSequence", SOLE_ARV_OK),
            1);
  GError* error = nullptr;
  arv_chunk_parser_get_integer_value(parser, buffer, "ChunkFrameID", &error);
  EXPECT_NE(error, nullptr);
  g_clear_error(&error);
  arv_stream_push_buffer(client.Stream(), buffer);
  g_object_unref(parser);
  arv_device_write_register(client.Device(), 0x10700, 0, &error);
  EXPECT_NE(error, nullptr) << "the format stays while frames flow";
  g_clear_error(&error);

  client.Stop();
  arv_camera_set_chunk_mode(camera, FALSE, SOLE_ARV_OK);
  arv_camera_set_region(camera, 0, 0, kWidth, kHeight, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_get_payload(camera, SOLE_ARV_OK), plain);
  client.Start("Software");
  arv_camera_software_trigger(camera, SOLE_ARV_OK);
  buffer = arv_stream_timeout_pop_buffer(client.Stream(), 5000000);
  ASSERT_NE(buffer, nullptr);
  EXPECT_EQ(arv_buffer_get_status(buffer), ARV_BUFFER_STATUS_SUCCESS);
  EXPECT_FALSE(arv_buffer_has_chunks(buffer));
  arv_stream_push_buffer(client.Stream(), buffer);
}

}  // namespace
}  // namespace sole::sim
