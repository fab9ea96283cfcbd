#include "io/archive_video_internal.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
}

#include <cerrno>
#include <cstring>

#include "core/error.h"
#include "io/file_descriptor_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

constexpr char kMimeType[] = "application/x-sole-records";
constexpr int kMaxSide = 65535;
constexpr int kRowPadding = 64;  // libavcodec counts it
constexpr AVPixelFormat kGrey = AV_PIX_FMT_GRAY8;

struct CodecDeleter {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
};
struct FrameDeleter {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct PacketDeleter {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
struct InputDeleter {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
};
struct OutputDeleter {
  void operator()(AVFormatContext* context) const {
    if (context->pb != nullptr) avio_closep(&context->pb);
    avformat_free_context(context);
  }
};
using Codec = std::unique_ptr<AVCodecContext, CodecDeleter>;
using Frame = std::unique_ptr<AVFrame, FrameDeleter>;
using Packet = std::unique_ptr<AVPacket, PacketDeleter>;

std::string Reason(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

template <typename T>
T* NotNull(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

void Quiet() {
  // What libav has to say arrives as an error code.
  static const bool kOnce = (av_log_set_level(AV_LOG_QUIET), true);
  (void)kOnce;
}

/// Bytes that libav frees, with the zeros behind them that it expects.
void SetExtraData(AVCodecParameters* parameters, const std::string& bytes) {
  parameters->extradata =
      NotNull(static_cast<std::uint8_t*>(av_mallocz(bytes.size() + AV_INPUT_BUFFER_PADDING_SIZE)));
  std::memcpy(parameters->extradata, bytes.data(), bytes.size());
  parameters->extradata_size = static_cast<int>(bytes.size());
}

}  // namespace

struct VideoWriter::State {
  fs::path path;
  std::unique_ptr<AVFormatContext, OutputDeleter> file;
  Codec encoder;
  Frame frame;
  Packet packet;
  AVStream* video = nullptr;
  std::int64_t frames = 0;

  void Check(int code) const {
    Require(code >= 0, "cannot write " + path.string() + ": " + Reason(code) +
                           ": check that the folder is writable and has room");
  }

  void OpenEncoder(const VideoFormat& format) {
    const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
    Require(codec != nullptr, "this libavcodec has no FFV1 encoder: install Debian's");
    encoder.reset(NotNull(avcodec_alloc_context3(codec)));
    encoder->width = format.width;
    encoder->height = format.height;
    encoder->pix_fmt = kGrey;
    encoder->time_base = av_inv_q(av_d2q(format.rate_hz, 100000));
    encoder->framerate = av_inv_q(encoder->time_base);
    encoder->gop_size = 1;  // every frame stands alone
    encoder->level = 3;
    encoder->slices = 4;
    encoder->thread_count = 1;  // cameras are compressed side by side
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
    Check(av_opt_set(encoder->priv_data, "coder", "rice", 0));
    Check(av_opt_set_int(encoder->priv_data, "slicecrc", 1, 0));
    Check(avcodec_open2(encoder.get(), codec, nullptr));
  }

  void OpenFile(const VideoFormat& format) {
    AVFormatContext* context = nullptr;
    Check(avformat_alloc_output_context2(&context, nullptr, "matroska", nullptr));
    file.reset(context);
    file->flags |= AVFMT_FLAG_BITEXACT;
    video = NotNull(avformat_new_stream(file.get(), nullptr));
    Check(avcodec_parameters_from_context(video->codecpar, encoder.get()));
    video->time_base = encoder->time_base;
    video->avg_frame_rate = encoder->framerate;
    AVStream* attachment = NotNull(avformat_new_stream(file.get(), nullptr));
    attachment->codecpar->codec_type = AVMEDIA_TYPE_ATTACHMENT;
    attachment->codecpar->codec_id = AV_CODEC_ID_BIN_DATA;
    SetExtraData(attachment->codecpar, format.attachment);
    av_dict_set(&attachment->metadata, "filename", format.attachment_name.c_str(), 0);
    av_dict_set(&attachment->metadata, "mimetype", kMimeType, 0);
    Check(avio_open(&file->pb, path.c_str(), AVIO_FLAG_WRITE));
    Check(avformat_write_header(file.get(), nullptr));
  }

  /// Moves finished packets to the file.
  void Drain() {
    for (;;) {
      const int code = avcodec_receive_packet(encoder.get(), packet.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
      Check(code);
      av_packet_rescale_ts(packet.get(), encoder->time_base, video->time_base);
      packet->stream_index = video->index;
      Check(av_interleaved_write_frame(file.get(), packet.get()));
      Check(file->pb->error);
    }
  }
};

VideoWriter::VideoWriter(const fs::path& path, const VideoFormat& format)
    : state_(std::make_unique<State>()) {
  Quiet();
  State& state = *state_;
  state.path = path;
  state.OpenEncoder(format);
  state.OpenFile(format);
  state.packet.reset(NotNull(av_packet_alloc()));
  state.frame.reset(NotNull(av_frame_alloc()));
  state.frame->format = kGrey;
  state.frame->width = format.width;
  state.frame->height = format.height;
  state.Check(av_frame_get_buffer(state.frame.get(), 0));
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::Append(const std::uint8_t* pixels) {
  State& state = *state_;
  state.Check(av_frame_make_writable(state.frame.get()));
  const auto width = static_cast<std::size_t>(state.frame->width);
  for (int y = 0; y < state.frame->height; ++y) {
    std::memcpy(state.frame->data[0] + static_cast<std::ptrdiff_t>(y) * state.frame->linesize[0],
                pixels + static_cast<std::size_t>(y) * width, width);
  }
  state.frame->pts = state.frames++;
  state.Check(avcodec_send_frame(state.encoder.get(), state.frame.get()));
  state.Drain();
}

void VideoWriter::Close() {
  State& state = *state_;
  state.Check(avcodec_send_frame(state.encoder.get(), nullptr));
  state.Drain();
  state.Check(av_write_trailer(state.file.get()));
  state.Check(state.file->pb->error);
  state.Check(avio_closep(&state.file->pb));
  const FileDescriptor file(::open(state.path.c_str(), O_RDONLY | O_CLOEXEC));
  state.Check(file.Valid() && ::fsync(file.Get()) == 0 ? 0 : AVERROR(errno));
}

struct VideoReader::State {
  fs::path path;
  VideoFormat format;
  std::unique_ptr<AVFormatContext, InputDeleter> file;
  Codec decoder;
  Frame frame;
  Packet packet;
  int video = -1;
  bool ended = false;

  void Check(bool good, const std::string& what) const {
    Require(good, path.string() + ": " + what);
  }

  void FindStreams() {
    for (unsigned i = 0; i < file->nb_streams; ++i) {
      const AVCodecParameters* p = file->streams[i]->codecpar;
      if (p->codec_type == AVMEDIA_TYPE_VIDEO && video < 0) {
        video = static_cast<int>(i);
      } else if (p->codec_type == AVMEDIA_TYPE_ATTACHMENT && p->extradata_size > 0) {
        const AVDictionaryEntry* type =
            av_dict_get(file->streams[i]->metadata, "mimetype", nullptr, 0);
        if (type == nullptr || std::strcmp(type->value, kMimeType) != 0) continue;
        format.attachment.assign(reinterpret_cast<const char*>(p->extradata),
                                 static_cast<std::size_t>(p->extradata_size));
      }
    }
    Check(video >= 0 && !format.attachment.empty(),
          "is no archive of a recording: it has no video or no list of records");
  }

  void OpenDecoder() {
    const AVStream* stream = file->streams[video];
    const AVCodecParameters* parameters = stream->codecpar;
    Check(parameters->codec_id == AV_CODEC_ID_FFV1, "is no archive of a recording: it is not FFV1");
    Check(parameters->width > 0 && parameters->height > 0 && parameters->width <= kMaxSide &&
              parameters->height <= kMaxSide,
          "has an impossible image size");
    format.width = parameters->width;
    format.height = parameters->height;
    const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_FFV1);
    Check(codec != nullptr, "this libavcodec has no FFV1 decoder: install Debian's");
    decoder.reset(NotNull(avcodec_alloc_context3(codec)));
    decoder->thread_count = 1;
    decoder->err_recognition = AV_EF_CRCCHECK | AV_EF_EXPLODE;
    decoder->max_pixels = (std::int64_t{format.width} + kRowPadding) * format.height;
    Check(avcodec_parameters_to_context(decoder.get(), parameters) >= 0 &&
              avcodec_open2(decoder.get(), codec, nullptr) >= 0,
          "its video cannot be decoded: the file is damaged");
  }

  ImageU8 Take() const {
    Check(frame->width == format.width && frame->height == format.height &&
              frame->format == kGrey && frame->decode_error_flags == 0 &&
              (frame->flags & AV_FRAME_FLAG_CORRUPT) == 0,
          "a frame is damaged");
    ImageU8 image(format.width, format.height);
    for (int y = 0; y < image.height; ++y) {
      std::memcpy(image.Row(y).data(),
                  frame->data[0] + static_cast<std::ptrdiff_t>(y) * frame->linesize[0],
                  image.Row(y).size());
    }
    return image;
  }
};

VideoReader::VideoReader(const fs::path& path) : state_(std::make_unique<State>()) {
  Quiet();
  State& state = *state_;
  state.path = path;
  std::error_code error;
  Require(fs::is_regular_file(path, error),
          "cannot read " + path.string() + ": there is no such file");
  AVFormatContext* context = nullptr;
  const int code = avformat_open_input(&context, ("file:" + path.string()).c_str(),
                                       av_find_input_format("matroska"), nullptr);
  state.Check(code >= 0, "is not a Matroska file that can be read: " + Reason(code));
  state.file.reset(context);
  state.FindStreams();
  state.OpenDecoder();
  state.frame.reset(NotNull(av_frame_alloc()));
  state.packet.reset(NotNull(av_packet_alloc()));
}

VideoReader::~VideoReader() = default;

const VideoFormat& VideoReader::Format() const { return state_->format; }

std::optional<ImageU8> VideoReader::Next() {
  State& state = *state_;
  for (;;) {
    const int got = avcodec_receive_frame(state.decoder.get(), state.frame.get());
    if (got == 0) return state.Take();
    if (got == AVERROR_EOF) return {};
    state.Check(got == AVERROR(EAGAIN), "a frame is damaged: " + Reason(got));
    int sent = 0;
    const int read = av_read_frame(state.file.get(), state.packet.get());
    if (read == AVERROR_EOF) {
      sent = avcodec_send_packet(state.decoder.get(), nullptr);
    } else {
      state.Check(read >= 0, "cannot be read to its end: " + Reason(read));
      if (state.packet->stream_index == state.video)
        sent = avcodec_send_packet(state.decoder.get(), state.packet.get());
      av_packet_unref(state.packet.get());
    }
    state.Check(sent >= 0, "a frame is damaged: " + Reason(sent));
  }
}

}  // namespace sole::io
