// The slot for a new firmware of a virtual device, as functions of a platform in another language.
#include <string.h>

#include "../platform/host/virtual_device.h"

using gemelo::FirmwareCalls;
using gemelo::Refusal;
using gemelo::VirtualDevice;

namespace {

const FirmwareCalls& calls_of(void* self) { return static_cast<VirtualDevice*>(self)->firmware_calls(); }

bool verify(void* self, const uint8_t* digest, const uint8_t* signature, size_t size, Refusal* refusal) {
    return calls_of(self).verify(digest, signature, size, refusal->reason) != 0;
}
bool begin(void* self, uint32_t size, Refusal* refusal) { return calls_of(self).begin(size, refusal->reason) != 0; }
bool write(void* self, const uint8_t* bytes, size_t size, Refusal* refusal) {
    return calls_of(self).write(bytes, size, refusal->reason) != 0;
}
bool finish(void* self, const uint8_t* digest, Refusal* refusal) {
    return calls_of(self).finish(digest, refusal->reason) != 0;
}
bool permits_older(void* self, const uint8_t* digest, uint32_t boot_id, const uint8_t* signature, size_t size) {
    return calls_of(self).permits_older(digest, boot_id, signature, size) != 0;
}
void abort(void* self) { calls_of(self).abort(); }

}  // namespace

// They must stay for as long as the device does.
extern "C" void gemelo_set_firmware_slot(VirtualDevice* device, const FirmwareCalls* calls) {
    device->firmware_calls() = *calls;
    device->firmware() = {device, gemelo::kVirtualChip, verify, begin, write, finish, abort, permits_older};
}
