#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

namespace stereotrack::telemetry {

/// Who wrote a datagram, proven by a secret that sender and receivers share: its last 25 bytes are
///     F5 7F  key id, 4 bytes, low byte first      field 2046, fixed32
///     FA 7F  10  hash, 16 bytes                   field 2047
///     hash = BLAKE2b(key, 16 bytes out) over all bytes of the datagram before FA 7F
/// (RFC 7693; libsodium's crypto_generichash, Python's hashlib.blake2b(key=, digest_size=16)). Datagrams are not
/// encrypted. Who holds the key can sign as any rig: a rig of its own wants a key of its own.
inline constexpr std::size_t kKeyBytes = 32;
inline constexpr std::size_t kHashBytes = 16;
inline constexpr std::size_t kTrailerBytes = 2 + 4 + 2 + 1 + kHashBytes;

struct Key {
  std::uint32_t id = 0;
  std::array<std::uint8_t, kKeyBytes> secret{};
};

/// A key file cannot be used; the line names it and the way out. Bad configuration: exit code 2.
class KeyFileError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Text, a key a line: ID HEX, the id a number from 0 to 4294967295, the secret 64 hexadecimal digits. Empty lines
/// and those that begin with # do not count. Senders sign with the first key, receivers take each: to change keys,
/// give receivers both, then senders the new one first.
///     (umask 077 && echo "1 $(openssl rand -hex 32)" > telemetry.key)
/// It must be a file of this user's or root's that no one else may read or write (chmod 600). 1..kMaxKeys keys; ids
/// differ. Throws KeyFileError.
inline constexpr std::size_t kMaxKeys = 8;
[[nodiscard]] std::vector<Key> load_key_file(const std::filesystem::path& path);

/// Signs with one key. Any number of threads. sign() takes no memory and makes no system call: a few microseconds.
class Signer {
 public:
  /// Throws std::runtime_error if libsodium cannot be used.
  explicit Signer(const Key& key);
  Signer(const Signer&) = delete;
  Signer& operator=(const Signer&) = delete;
  ~Signer();

  /// Appends the trailer to the first `size` bytes. The new size; 0 if there is no room for it: nothing is to be sent.
  [[nodiscard]] std::size_t sign(std::span<std::byte> buffer, std::size_t size) const noexcept;
  [[nodiscard]] std::uint32_t key_id() const noexcept { return key_.id; }

 private:
  Key key_;
};

/// What a datagram says without its trailer: what replays and recordings compare. All of it if there is none.
[[nodiscard]] std::span<const std::byte> payload_of(std::span<const std::byte> datagram) noexcept;

/// Which key signed it, as it says; none: it has no trailer.
[[nodiscard]] std::optional<std::uint32_t> key_id_of(std::span<const std::byte> datagram) noexcept;

enum class Seal : std::uint8_t {
  kNone,        ///< no trailer
  kUnknownKey,  ///< a key id that is not among `keys`
  kWrong,       ///< the hash is another one: forged or altered
  kGood,
};
/// Compares in constant time; no heap. sodium_init() must have been called: loading a key file does.
[[nodiscard]] Seal check_seal(std::span<const std::byte> datagram, std::span<const Key> keys) noexcept;

}  // namespace stereotrack::telemetry
