#include "cobs.h"

namespace gemelo {

void CobsWriter::close() {
    out_[code_at_] = static_cast<uint8_t>(size_ - code_at_);
    code_at_ = size_++;
}

void CobsWriter::put(const uint8_t* bytes, size_t size) {
    for (size_t i = 0; i < size; ++i) {
        if (size_ - code_at_ == 255) close();
        if (bytes[i] == 0) {
            close();
        } else {
            out_[size_++] = bytes[i];
        }
    }
}

size_t CobsWriter::finish() {
    out_[0] = 0;
    close();
    out_[code_at_] = 0;
    return size_;
}

bool CobsReader::put(uint8_t byte, uint8_t* out) {
    if (left_ != 0) {
        --left_;
        *out = byte;
        return true;
    }
    const bool is_zero = owes_zero_;
    left_ = static_cast<uint8_t>(byte - 1);
    owes_zero_ = byte != 255;
    *out = 0;
    return is_zero;
}

}  // namespace gemelo
