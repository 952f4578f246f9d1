#include "drivers/telemetry/authentication.hpp"

#include <sodium.h>

#include <algorithm>
#include <cstring>

namespace stereotrack::telemetry {
namespace {

static_assert(kKeyBytes == crypto_generichash_KEYBYTES && kHashBytes >= crypto_generichash_BYTES_MIN);

constexpr std::array kIdField{std::byte{0xF5}, std::byte{0x7F}};                   // 2046, 4 bytes
constexpr std::array kHashField{std::byte{0xFA}, std::byte{0x7F}, std::byte{16}};  // 2047, so many bytes
constexpr std::size_t kIdBytes = 4;
constexpr std::size_t kHashedOfTrailer = kIdField.size() + kIdBytes;
static_assert(kHashedOfTrailer + kHashField.size() + kHashBytes == kTrailerBytes);

using Hash = std::array<std::byte, kHashBytes>;

Hash hash_of(std::span<const std::byte> bytes, const Key& key) noexcept {
  Hash hash{};
  // Fails only for sizes that the assertion above excludes.
  (void)crypto_generichash(reinterpret_cast<unsigned char*>(hash.data()), hash.size(),
                           reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), key.secret.data(),
                           key.secret.size());
  return hash;
}

}  // namespace

Signer::Signer(const Key& key) : key_(key) {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used: telemetry cannot be signed");
}

Signer::~Signer() { sodium_memzero(key_.secret.data(), key_.secret.size()); }

std::size_t Signer::sign(std::span<std::byte> buffer, std::size_t size) const noexcept {
  if (size > buffer.size() || buffer.size() - size < kTrailerBytes) return 0;
  std::byte* to = std::ranges::copy(kIdField, buffer.data() + size).out;
  for (unsigned i = 0; i < kIdBytes; ++i) *to++ = static_cast<std::byte>(key_.id >> (8 * i));
  const Hash hash = hash_of(buffer.first(size + kHashedOfTrailer), key_);
  to = std::ranges::copy(kHashField, to).out;
  std::ranges::copy(hash, to);
  return size + kTrailerBytes;
}

std::optional<std::uint32_t> key_id_of(std::span<const std::byte> datagram) noexcept {
  if (datagram.size() < kTrailerBytes) return std::nullopt;
  const auto trailer = datagram.last(kTrailerBytes);
  if (!std::ranges::equal(trailer.first(kIdField.size()), kIdField) ||
      !std::ranges::equal(trailer.subspan(kHashedOfTrailer, kHashField.size()), kHashField)) {
    return std::nullopt;
  }
  std::uint32_t id = 0;
  for (unsigned i = 0; i < kIdBytes; ++i) {
    id |= static_cast<std::uint32_t>(trailer[kIdField.size() + i]) << (8 * i);
  }
  return id;
}

std::span<const std::byte> payload_of(std::span<const std::byte> datagram) noexcept {
  return key_id_of(datagram) ? datagram.first(datagram.size() - kTrailerBytes) : datagram;
}

Seal check_seal(std::span<const std::byte> datagram, std::span<const Key> keys) noexcept {
  const auto id = key_id_of(datagram);
  if (!id) return Seal::kNone;
  const auto key = std::ranges::find(keys, *id, &Key::id);
  if (key == keys.end()) return Seal::kUnknownKey;
  const Hash hash = hash_of(datagram.first(datagram.size() - kHashField.size() - kHashBytes), *key);
  return sodium_memcmp(hash.data(), datagram.last(kHashBytes).data(), kHashBytes) == 0 ? Seal::kGood : Seal::kWrong;
}

}  // namespace stereotrack::telemetry
