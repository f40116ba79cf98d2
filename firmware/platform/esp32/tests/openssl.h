// Keys, signatures and checksums of the openssl command.
#pragma once

#include <string>

namespace fake {

// What it has written; nothing where it failed.
std::string run(const std::string& command);

// A file for as long as it lives.
struct File {
    explicit File(const std::string& content);
    ~File();
    std::string path;
};

std::string sha256(const std::string& bytes);

// A pair for ECDSA with P-256.
struct Key {
    Key();
    std::string sign(const std::string& bytes) const;
    std::string secret, shown;  // PEM
};

}  // namespace fake
