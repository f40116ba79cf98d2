// mbedtls as far as the layer uses it, by the openssl command: checksums and signatures are real.
#include <cstdio>
#include <cstring>
#include <string>

#include "mbedtls/pk.h"
#include "mbedtls/sha256.h"
#include "openssl.h"

namespace fake {

std::string run(const std::string& command) {
    std::string out;
    FILE* const pipe = popen((command + " 2>/dev/null").c_str(), "r");
    for (int byte = fgetc(pipe); byte != EOF; byte = fgetc(pipe)) out.push_back(static_cast<char>(byte));
    return pclose(pipe) == 0 ? out : std::string();
}

File::File(const std::string& content) {
    char name[] = "/tmp/gemelo_layer_XXXXXX";
    FILE* const file = fdopen(mkstemp(name), "w");
    fwrite(content.data(), 1, content.size(), file);
    fclose(file);
    path = name;
}

File::~File() { remove(path.c_str()); }

std::string sha256(const std::string& bytes) { return run("openssl dgst -sha256 -binary " + File(bytes).path); }

Key::Key() {
    secret = run("openssl ecparam -genkey -name prime256v1 -noout");
    shown = run("openssl pkey -pubout -in " + File(secret).path);
}

std::string Key::sign(const std::string& bytes) const {
    return run("openssl dgst -sha256 -sign " + File(secret).path + " " + File(bytes).path);
}

}  // namespace fake

using fake::File;

namespace {

// What was hashed so far; its address is what the context holds, at no place in particular.
std::string* text_of(const mbedtls_sha256_context* context) {
    std::string* text = nullptr;
    memcpy(&text, context->private_state, sizeof text);
    return text;
}

void set_text(mbedtls_sha256_context* context, std::string* text) {
    memcpy(context->private_state, &text, sizeof text);
}

}  // namespace

extern "C" {
void mbedtls_sha256_init(mbedtls_sha256_context* context) { memset(context, 0, sizeof *context); }
void mbedtls_sha256_free(mbedtls_sha256_context* context) {
    delete text_of(context);
    set_text(context, nullptr);
}
int mbedtls_sha256_starts(mbedtls_sha256_context* context, int) {
    set_text(context, new std::string);
    return 0;
}
int mbedtls_sha256_update(mbedtls_sha256_context* context, const unsigned char* bytes, size_t size) {
    text_of(context)->append(reinterpret_cast<const char*>(bytes), size);
    return 0;
}
int mbedtls_sha256_finish(mbedtls_sha256_context* context, unsigned char* out) {
    memcpy(out, fake::sha256(*text_of(context)).data(), 32);
    return 0;
}

void mbedtls_pk_init(mbedtls_pk_context* context) { *context = {}; }
void mbedtls_pk_free(mbedtls_pk_context*) {}
int mbedtls_pk_parse_public_key(mbedtls_pk_context* context, const unsigned char* key, size_t size) {
    const char* text = reinterpret_cast<const char*>(key);
    context->private_context = const_cast<char*>(text);
    return size == strlen(text) + 1 && strstr(text, "-----BEGIN PUBLIC KEY-----") != nullptr ? 0 : -0x3D00;
}
int mbedtls_pk_can_do(const mbedtls_pk_context*, mbedtls_pk_type_t type) { return type == MBEDTLS_PK_ECDSA; }
int mbedtls_pk_verify(mbedtls_pk_context* context, mbedtls_md_type_t, const unsigned char* digest, size_t digest_size,
                      const unsigned char* signature, size_t signature_size) {
    const File key(static_cast<const char*>(context->private_context));
    const File hash(std::string(reinterpret_cast<const char*>(digest), digest_size));
    const File signed_by(std::string(reinterpret_cast<const char*>(signature), signature_size));
    const std::string said = fake::run("openssl pkeyutl -verify -pubin -inkey " + key.path + " -in " + hash.path +
                                       " -sigfile " + signed_by.path + " -pkeyopt digest:sha256");
    return said.find("Success") == std::string::npos ? -0x4E00 : 0;
}
}
