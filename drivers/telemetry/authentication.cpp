#include "drivers/telemetry/authentication.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string>
#include <string_view>

#include "drivers/telemetry/endpoint.hpp"

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

constexpr std::size_t kMostFileBytes = 16 * 1024;

/// Memory that held secrets is wiped before it is given back.
struct SecretText {
  std::array<char, kMostFileBytes> bytes{};
  std::size_t size = 0;

  SecretText() = default;
  SecretText(const SecretText&) = delete;
  SecretText& operator=(const SecretText&) = delete;
  ~SecretText() { sodium_memzero(bytes.data(), bytes.size()); }
};

void start_sodium() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used: telemetry cannot be authenticated");
}

std::string_view trimmed(std::string_view text) noexcept {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// False if it is not ID HEX.
bool parse_key(std::string_view line, Key& key) noexcept {
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), key.id);
  if (error != std::errc{}) return false;
  std::string_view digits = line.substr(static_cast<std::size_t>(end - line.data()));
  if (digits.empty() || (digits.front() != ' ' && digits.front() != '\t')) return false;
  digits = trimmed(digits);
  std::size_t size = 0;
  return digits.size() == 2 * kKeyBytes &&
         sodium_hex2bin(key.secret.data(), kKeyBytes, digits.data(), digits.size(), nullptr, &size, nullptr) == 0 &&
         size == kKeyBytes;
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw KeyFileError("key file " + path.string() + ": " + why);
}

void read_secret(const std::filesystem::path& path, SecretText& text) {
  // O_NONBLOCK: a pipe must not hang the start. What is checked is what was opened, not what the name means later.
  const Socket file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK));
  if (file.fd() < 0) {
    refuse(path, std::string("cannot be read: ") + std::strerror(errno) +
                     "; make one with: (umask 077 && echo \"1 $(openssl rand -hex 32)\" > FILE)");
  }
  struct stat facts {};
  if (::fstat(file.fd(), &facts) != 0 || !S_ISREG(facts.st_mode)) refuse(path, "is no file; name the file itself");
  if (facts.st_uid != 0 && facts.st_uid != ::geteuid()) {
    refuse(path, "belongs to another user, who could change it; chown it to the user who runs this program");
  }
  if ((facts.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    refuse(path, "others may read or write it; run: chmod 600 " + path.string());
  }
  while (text.size < text.bytes.size()) {
    const ssize_t got = ::read(file.fd(), text.bytes.data() + text.size, text.bytes.size() - text.size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) refuse(path, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) return;
    text.size += static_cast<std::size_t>(got);
  }
  refuse(path, "is larger than " + std::to_string(kMostFileBytes) + " bytes: is it the right file?");
}

}  // namespace

std::vector<Key> load_key_file(const std::filesystem::path& path) {
  start_sodium();
  SecretText text;
  read_secret(path, text);
  std::vector<Key> keys;
  keys.reserve(kMaxKeys);
  std::string_view rest(text.bytes.data(), text.size);
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = trimmed(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line.empty() || line.front() == '#') continue;
    // The line itself is not repeated in messages: it is a secret.
    const std::string where = "line " + std::to_string(number) + ": ";
    Key key;
    if (!parse_key(line, key)) refuse(path, where + "write ID HEX: a number and 64 hexadecimal digits");
    if (std::ranges::find(keys, key.id, &Key::id) != keys.end()) {
      refuse(path, where + "key id " + std::to_string(key.id) + " stands there twice; give each key its own");
    }
    if (keys.size() == kMaxKeys)
      refuse(path, where + "more than " + std::to_string(kMaxKeys) + " keys; remove old ones");
    keys.push_back(key);
  }
  if (keys.empty()) refuse(path, "holds no key; write one as ID HEX: a number and 64 hexadecimal digits");
  return keys;
}

Signer::Signer(const Key& key) : key_(key) { start_sodium(); }

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
