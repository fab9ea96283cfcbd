#include "sim/gige/gvsp_sender.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/socket.h>

namespace sole::sim {
namespace {

constexpr std::size_t kMaxWaiting = 64;
constexpr std::size_t kMaxResends = 1024, kMaxTestPackets = 16;  // A client repeats what is dropped.
constexpr std::uint32_t kMaxBatch = 64;
constexpr std::chrono::nanoseconds kBatchTime = std::chrono::milliseconds(1);

/// Time one packet takes: its bytes on the link and the delay the application asked for.
std::chrono::nanoseconds PacketTime(const StreamSettings& settings, double link_mbit_per_s) {
  const double link_ns = settings.packet_size * 8.0 * 1000.0 / link_mbit_per_s;
  return std::chrono::nanoseconds(static_cast<std::int64_t>(link_ns) + settings.packet_delay_ns);
}

}  // namespace

GvspSender::GvspSender(const GvspSenderOptions& options, FrameProvider provider)
    : options_(options),
      provider_(std::move(provider)),
      socket_({options.address, 0}, "a simulated camera's stream"),
      next_frame_id_(options.first_frame_id),
      random_(options.seed) {
  thread_ = std::thread([this] { Run(); });
}

GvspSender::~GvspSender() {
  {
    const Lock lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

bool GvspSender::Expose(const TriggerPulse& pulse, const StreamSettings& settings) {
  const Lock lock(mutex_);
  if (settings.destination.port == 0) return false;
  if (exposures_.size() >= kMaxWaiting) {
    ++stats_.triggers_refused;
    return false;
  }
  exposures_.push_back({pulse, settings, Clock::now() + settings.faults.begins_later});
  wake_.notify_all();
  return true;
}

void GvspSender::Resend(std::uint16_t frame_id, std::uint32_t first_packet,
                        std::uint32_t last_packet) {
  const Lock lock(mutex_);
  if (resends_.size() >= kMaxResends) return;
  resends_.push_back({frame_id, first_packet, last_packet});
  wake_.notify_all();
}

void GvspSender::SendTestPacket(const StreamSettings& settings) {
  const Lock lock(mutex_);
  if (test_packets_.size() >= kMaxTestPackets) return;
  test_packets_.push_back(settings);
  wake_.notify_all();
}

void GvspSender::Clear() {
  const Lock lock(mutex_);
  exposures_.clear();
}

void GvspSender::RestartFrameIds() {
  const Lock lock(mutex_);
  next_frame_id_ = options_.first_frame_id;
  last_frame_id_ = 0;
}

void GvspSender::SetFaults(const CameraFaults& faults) {
  const Lock lock(mutex_);
  faults_ = faults;
}

bool GvspSender::Dead() const {
  const Lock lock(mutex_);
  return faults_.dead;
}

void GvspSender::SetSilent(bool silent) {
  const Lock lock(mutex_);
  silent_ = silent;
}

bool GvspSender::Exposing() const {
  const Lock lock(mutex_);
  return exposing_;
}

bool GvspSender::Idle() const {
  const Lock lock(mutex_);
  return exposures_.empty() && !sending_;
}

ServedCameraStats GvspSender::Stats() const {
  const Lock lock(mutex_);
  return stats_;
}

void GvspSender::Run() {
  pthread_setname_np(pthread_self(), fmt::format("sole-cam-{}", options_.camera + 1).c_str());
  Lock lock(mutex_);
  while (!stop_) {
    ServeRequests(&lock);
    if (!exposures_.empty()) {
      const Exposure exposure = exposures_.front();
      exposures_.pop_front();
      sending_ = true;
      SendFrame(exposure, &lock);
      exposing_ = sending_ = false;
      continue;
    }
    wake_.wait(lock, [&] {
      return stop_ || !exposures_.empty() || !resends_.empty() || !test_packets_.empty();
    });
  }
}

void GvspSender::SendFrame(const Exposure& exposure, Lock* lock) {
  ++stats_.triggers;
  exposing_ = true;
  SentFrame& frame = ring_[ring_next_];
  ring_next_ = (ring_next_ + 1) % ring_.size();
  frame.id = 0;
  frame.settings = exposure.settings;
  lock->unlock();
  std::string error;
  const FrameFaults& faults = frame.settings.faults;
  const TriggerPulse shown = faults.shows.value_or(exposure.pulse);
  try {
    SetPixels(provider_(options_.camera, shown), &frame);
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  lock->lock();
  const auto exposure_time =
      std::chrono::nanoseconds(static_cast<std::int64_t>(exposure.settings.exposure_us * 1000));
  if (!WaitUntil(exposure.begin + exposure_time, lock)) return;
  exposing_ = false;
  if (!error.empty()) {
    stats_.last_error = error;
    return;
  }
  frame.id = TakeFrameId(faults);
  SetChunks(shown.sequence, &frame);
  if (faults.late.count() > 0 && !WaitUntil(exposure.begin + exposure_time + faults.late, lock))
    return;

  const std::chrono::nanoseconds packet_time = PacketTime(frame.settings, options_.link_mbit_per_s);
  const auto batch = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      kBatchTime / std::max(packet_time, std::chrono::nanoseconds(1)), 1, kMaxBatch));
  const std::uint32_t packets = PacketCount(frame);
  Clock::time_point next = Clock::now();
  for (std::uint32_t first = 0; first < packets; first += batch) {
    if (!WaitUntil(next, lock)) return;
    const std::uint32_t count = std::min(batch, packets - first);
    SendPackets(frame, first, count, GevStatus::kSuccess, lock);
    next += count * packet_time;
  }
  ++stats_.frames_sent;
}

std::uint16_t GvspSender::TakeFrameId(const FrameFaults& faults) {
  if (faults.repeats_id && last_frame_id_ != 0) return last_frame_id_;
  for (int i = 0; i < faults.skipped_ids; ++i) next_frame_id_ = NextFrameId(next_frame_id_);
  if (faults_.skip_frame_id_after == stats_.frames_sent)
    next_frame_id_ = NextFrameId(next_frame_id_);
  last_frame_id_ = next_frame_id_;
  return std::exchange(next_frame_id_, NextFrameId(next_frame_id_));
}

bool GvspSender::WaitUntil(Clock::time_point deadline, Lock* lock) {
  for (;;) {
    ServeRequests(lock);
    if (stop_) return false;
    if (!wake_.wait_until(*lock, deadline,
                          [&] { return stop_ || !resends_.empty() || !test_packets_.empty(); })) {
      return true;
    }
  }
}

void GvspSender::ServeRequests(Lock* lock) {
  while (!stop_ && !test_packets_.empty()) {
    const StreamSettings settings = test_packets_.front();
    test_packets_.pop_front();
    const std::vector<std::uint8_t> zeros(settings.packet_size - kIpUdpHeaderSize, 0);
    GvspPacket packet;
    packet.pixels = zeros;
    Transmit({packet}, settings, lock);
  }
  while (!stop_ && !resends_.empty()) {
    const ResendRequest request = resends_.front();
    resends_.pop_front();
    ServeResend(request, lock);
  }
}

void GvspSender::ServeResend(const ResendRequest& request, Lock* lock) {
  const auto found = std::find_if(ring_.begin(), ring_.end(), [&](const SentFrame& frame) {
    return frame.id != 0 && frame.id == request.frame_id;
  });
  if (request.last < request.first) return;
  if (found == ring_.end()) {
    stats_.resends_requested += request.last - request.first + 1;
    stats_.resends_refused += request.last - request.first + 1;
    // The newest frame's destination is the one application that can ask.
    const SentFrame& newest = ring_[(ring_next_ + ring_.size() - 1) % ring_.size()];
    if (newest.settings.destination.port == 0) return;
    Transmit({MakeUnavailable(request.frame_id, request.first)}, newest.settings, lock);
    return;
  }
  const std::uint32_t last = std::min(request.last, PacketCount(*found) - 1);
  if (last < request.first) return;
  stats_.resends_requested += last - request.first + 1;
  for (std::uint32_t first = request.first; first <= last; first += kMaxBatch) {
    SendPackets(*found, first, std::min(kMaxBatch, last - first + 1), GevStatus::kPacketResend,
                lock);
  }
}

void GvspSender::SendPackets(const SentFrame& frame, std::uint32_t first, std::uint32_t count,
                             GevStatus status, Lock* lock) {
  std::vector<GvspPacket> packets;
  packets.reserve(count);
  for (std::uint32_t id = first; id < first + count; ++id)
    packets.push_back(MakePacket(frame, id, status));
  Transmit(std::move(packets), frame.settings, lock);
}

void GvspSender::Transmit(std::vector<GvspPacket> packets, const StreamSettings& settings,
                          Lock* lock) {
  if (faults_.dead || silent_) return;
  const double drop_probability =
      std::max(faults_.packet_drop_probability, settings.faults.packet_drop_probability);
  if (drop_probability > 0) {
    std::bernoulli_distribution drop(drop_probability);
    const auto kept = std::erase_if(packets, [&](const GvspPacket&) { return drop(random_); });
    stats_.packets_dropped += static_cast<std::int64_t>(kept);
  }
  lock->unlock();
  if (settings.do_not_fragment != do_not_fragment_) {
    do_not_fragment_ = settings.do_not_fragment;
    const int mode = do_not_fragment_ ? IP_PMTUDISC_DO : IP_PMTUDISC_DONT;
    setsockopt(socket_.Descriptor(), IPPROTO_IP, IP_MTU_DISCOVER, &mode, sizeof mode);
  }
  sockaddr_in destination{};
  destination.sin_family = AF_INET;
  destination.sin_addr.s_addr = htonl(settings.destination.address);
  destination.sin_port = htons(settings.destination.port);
  std::vector<std::array<iovec, 3>> parts(packets.size());
  std::vector<mmsghdr> messages(packets.size());
  for (std::size_t i = 0; i < packets.size(); ++i) {
    parts[i][0] = {packets[i].header.data(), packets[i].header_size};
    parts[i][1] = {const_cast<std::uint8_t*>(packets[i].pixels.data()), packets[i].pixels.size()};
    parts[i][2] = {const_cast<std::uint8_t*>(packets[i].chunks.data()), packets[i].chunks.size()};
    messages[i].msg_hdr.msg_name = &destination;
    messages[i].msg_hdr.msg_namelen = sizeof destination;
    messages[i].msg_hdr.msg_iov = parts[i].data();
    messages[i].msg_hdr.msg_iovlen = 3;
  }
  std::size_t done = 0;
  std::int64_t errors = 0;
  int last_error = 0;
  while (done < messages.size()) {
    const int sent = sendmmsg(socket_.Descriptor(), &messages[done],
                              static_cast<unsigned>(messages.size() - done), 0);
    if (sent > 0) {
      done += static_cast<std::size_t>(sent);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    } else if (errno != EINTR) {
      last_error = errno;
      ++errors;
      ++done;  // This packet cannot be sent; the client asks for it again.
    }
  }
  lock->lock();
  stats_.packets_sent += static_cast<std::int64_t>(messages.size()) - errors;
  stats_.send_errors += errors;
  if (errors > 0) stats_.last_error = std::strerror(last_error);
}

}  // namespace sole::sim
