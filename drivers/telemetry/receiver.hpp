#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <tl/expected.hpp>
#include <vector>

#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/datagram.hpp"
#include "drivers/telemetry/replay_guard.hpp"

namespace stereotrack::telemetry {

/// Why a datagram was not taken.
enum class Refusal : std::uint8_t {
  kEmpty,          ///< no bytes
  kOversized,      ///< more than kMaxDatagramBytes
  kMalformed,      ///< not protobuf, or beyond a bound of the schema
  kUnknownSchema,  ///< a schema that this reader does not know
  kTruncated,      ///< shorter than it says it is
  kInconsistent,   ///< fields contradict each other: part 3 of 2, two numbers for a position
  kNotFinite,      ///< a NaN or an infinity
  // By a receiver that has keys:
  kUnsigned,     ///< whole, and without a trailer
  kUnknownKey,   ///< signed with a key that is not among ours
  kForged,       ///< the hash is not that of these bytes: forged, or altered on the way
  kReplayed,     ///< was there before, or comes too late to tell
  kOldSession,   ///< of a session under the highest that was seen of its rig
  kTooManyRigs,  ///< well signed, but there is no room to remember one more rig
};
inline constexpr std::size_t kRefusals = 13;

[[nodiscard]] constexpr const char* to_string(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kEmpty: return "empty";
    case Refusal::kOversized: return "oversized";
    case Refusal::kMalformed: return "malformed";
    case Refusal::kUnknownSchema: return "unknown schema";
    case Refusal::kTruncated: return "truncated";
    case Refusal::kInconsistent: return "inconsistent";
    case Refusal::kNotFinite: return "not finite";
    case Refusal::kUnsigned: return "unsigned";
    case Refusal::kUnknownKey: return "unknown key";
    case Refusal::kForged: return "forged";
    case Refusal::kReplayed: return "replayed";
    case Refusal::kOldSession: return "old session";
    case Refusal::kTooManyRigs: return "too many rigs";
  }
  return "unknown";
}

/// One datagram's bytes. Fields that it does not know are skipped. Reads any bytes whatever without harm;
/// no heap, any thread. It proves form, not origin: anybody can write a valid datagram.
[[nodiscard]] tl::expected<Datagram, Refusal> decode(std::span<const std::byte> bytes) noexcept;

enum class Outcome : std::uint8_t {
  kRefused,    ///< see refusal()
  kDuplicate,  ///< this part was there before
  kStale,      ///< over kWindow messages old: too late to be used, already counted as lost
  kPart,       ///< new; other parts of its message are missing still. See datagram()
  kPair,       ///< new, and completes its message. See datagram() and pair()
  kStatus,     ///< no message about a pair: datagram().status
};

struct ReceiverCounters {
  std::uint64_t datagrams = 0;   ///< all that came
  std::uint64_t duplicates = 0;  ///< came twice
  std::uint64_t reordered = 0;   ///< new, but came after a later one
  std::uint64_t stale = 0;       ///< came over kWindow messages late
  std::uint64_t restarts = 0;    ///< a stream whose sequence began again
  std::uint64_t pairs = 0;       ///< messages that are complete
  std::uint64_t statuses = 0;    ///< datagrams with a status
  std::array<std::uint64_t, kRefusals> refused{};

  [[nodiscard]] std::uint64_t refused_total() const noexcept {
    std::uint64_t sum = 0;
    for (const std::uint64_t n : refused) sum += n;
    return sum;
  }
};

/// Datagrams in, whole messages out, with the books kept for each stream, that is (rig, session):
///     lost = highest sequence - first sequence + 1 - complete messages - (1 if the newest is incomplete)
/// so that a part that comes late, but within kWindow messages, takes its loss back. A sequence that
/// begins again at 1, or lies over 1024 back, is a sender that restarted under the same session.
/// With keys it takes only what is signed with one of them, once each (ReplayGuard), and of the highest session of each
/// rig: a repetition is kRefused, never kDuplicate, and a sender that begins again must raise its session. Without keys
/// it takes signed datagrams as well, and does not look at the signature.
/// Memory is taken when made; accept() takes none and is O(1). kStreams streams; a further one takes the
/// place of that which has been silent longest. One thread.
class Receiver {
 public:
  static constexpr std::size_t kWindow = 8;   ///< messages that may be incomplete at a time
  static constexpr std::size_t kStreams = 8;  ///< (rig, session) followed at a time

  Receiver() : Receiver(std::vector<Key>{}) {}
  explicit Receiver(std::vector<Key> keys);

  Outcome accept(std::span<const std::byte> bytes) noexcept;

  [[nodiscard]] Refusal refusal() const noexcept { return refusal_; }        ///< after kRefused
  [[nodiscard]] const Datagram& datagram() const noexcept { return last_; }  ///< after anything else
  [[nodiscard]] const Pair& pair() const noexcept { return pair_; }          ///< after kPair
  [[nodiscard]] const ReceiverCounters& counters() const noexcept { return counters_; }
  /// Of a receiver with keys: what it has seen, to be kept (save_marks) and given to a later one's restore().
  [[nodiscard]] std::span<const Mark> marks() const noexcept { return guard_.marks(); }
  void restore(std::span<const Mark> marks) noexcept { guard_.restore(marks); }

  /// Messages lost or incomplete: all streams, ended ones too.
  [[nodiscard]] std::uint64_t lost() const noexcept;
  /// Of one stream; 0 if it is not followed.
  [[nodiscard]] std::uint64_t lost(std::uint32_t rig, std::uint64_t session) const noexcept;

 private:
  struct Slot {
    std::uint64_t sequence = 0;  ///< 0 = unused
    std::uint32_t parts = 0;
    std::uint32_t have = 0;  ///< bit per part
    Header header;
    std::optional<Live> live;
    std::array<FixedVector<Target, kTargetsPerPart>, kMaxParts> targets;

    [[nodiscard]] bool complete() const noexcept { return have + 1 == 1U << parts; }
  };
  struct Stream {
    std::uint32_t rig = 0;
    std::uint64_t session = 0;
    std::uint64_t first = 0;
    std::uint64_t highest = 0;
    std::uint64_t complete = 0;
    std::uint64_t last_used = 0;  ///< count of datagrams then; 0 = free
    std::array<Slot, kWindow> slots;

    [[nodiscard]] std::uint64_t lost() const noexcept;
    void begin(const Header& header) noexcept;
  };

  Stream& stream_of(const Header& header) noexcept;
  Outcome refuse(Refusal refusal) noexcept;
  [[nodiscard]] tl::expected<Datagram, Refusal> authenticate(std::span<const std::byte> bytes) noexcept;

  std::vector<Key> keys_;  ///< none: anybody is believed
  ReplayGuard guard_;
  std::vector<Stream> streams_;
  Datagram last_;
  Pair pair_;
  Refusal refusal_ = Refusal::kEmpty;
  ReceiverCounters counters_;
  std::uint64_t lost_before_ = 0;  ///< by streams that ended
};

}  // namespace stereotrack::telemetry
