package main

import (
	"bytes"
	"crypto/pbkdf2"
	"crypto/sha512"
	"crypto/subtle"
	"encoding/base64"
	"fmt"
	"os"
	"strconv"
	"strings"
	"sync"

	mqtt "github.com/mochi-mqtt/server/v2"
	"github.com/mochi-mqtt/server/v2/packets"
)

const remedy = "`gemelo broker secure` writes it anew"

// secret is a password as mosquitto 2 keeps it: `$7$<iterations>$<salt>$<PBKDF2-HMAC-SHA512>`.
type secret struct {
	iterations int
	salt, hash []byte
}

// rights are the topic filters, split into levels, that a user may write and read.
type rights struct{ write, read [][]string }

// access lets users in by their passwords and to the topics of the ACL, from the files that mosquitto reads too.
type access struct {
	mqtt.HookBase
	isOpen  bool // for everybody and everything
	users   map[string]secret
	rights  map[string]*rights
	hashing sync.Mutex // so that a flood of wrong passwords has one processor and not all
}

func readAccess(users, acl string) (*access, error) {
	a := &access{isOpen: users == "" && acl == "", users: map[string]secret{}, rights: map[string]*rights{}}
	if a.isOpen {
		return a, nil
	}
	if err := eachLine(users, "the users", a.addUser); err != nil {
		return nil, err
	}
	var user string
	return a, eachLine(acl, "the ACL", func(line string) error { return a.addRight(&user, line) })
}

// eachLine gives every line that is neither empty nor a comment, without blanks around it.
func eachLine(path, what string, take func(string) error) error {
	content, err := os.ReadFile(path)
	if err != nil {
		return fmt.Errorf("%s cannot be read: %w; remedy: %s", what, err, remedy)
	}
	for i, line := range strings.Split(string(content), "\n") {
		line = strings.TrimSpace(line)
		if line == "" || line[0] == '#' {
			continue
		}
		if err := take(line); err != nil {
			return fmt.Errorf("%s, %s, line %d: %w; remedy: %s", what, path, i+1, err, remedy)
		}
	}
	return nil
}

func (a *access) addUser(line string) error {
	name, kept, _ := strings.Cut(line, ":")
	parts := strings.Split(kept, "$")
	if len(parts) != 5 || parts[1] != "7" {
		return fmt.Errorf("the password of %q is not in the form $7$<iterations>$<salt>$<hash>", name)
	}
	iterations, err := strconv.Atoi(parts[2])
	salt, saltErr := base64.StdEncoding.DecodeString(parts[3])
	hash, hashErr := base64.StdEncoding.DecodeString(parts[4])
	if err != nil || saltErr != nil || hashErr != nil || iterations < 1 || len(hash) != sha512.Size {
		return fmt.Errorf("the iterations, salt or hash of %q cannot be read", name)
	}
	a.users[name] = secret{iterations, salt, hash}
	return nil
}

// addRight takes `user NAME` and `topic [read|write|readwrite] FILTER`; `user` is whose lines follow.
func (a *access) addRight(user *string, line string) error {
	words := strings.Fields(line)
	switch {
	case len(words) == 2 && words[0] == "user":
		*user = words[1]
		a.rights[*user] = &rights{}
		return nil
	case len(words) < 2 || words[0] != "topic" || len(words) > 3:
		return fmt.Errorf("%q is neither user NAME nor topic read|write|readwrite FILTER", line)
	case *user == "":
		return fmt.Errorf("%q stands before the first user", line)
	}
	kind, filter := "readwrite", strings.Split(words[len(words)-1], "/")
	if len(words) == 3 {
		kind = words[1]
	}
	if kind != "read" && kind != "write" && kind != "readwrite" {
		return fmt.Errorf("%q: %s is not one of read, write, readwrite", line, kind)
	}
	if own := a.rights[*user]; kind != "read" {
		own.write = append(own.write, filter)
	}
	if own := a.rights[*user]; kind != "write" {
		own.read = append(own.read, filter)
	}
	return nil
}

func (a *access) ID() string { return "access" }

func (a *access) Provides(event byte) bool {
	return bytes.IndexByte([]byte{mqtt.OnConnectAuthenticate, mqtt.OnACLCheck, mqtt.OnPublish}, event) >= 0
}

// OnConnectAuthenticate holds the password, and the topic of the last will, which the library publishes unasked.
func (a *access) OnConnectAuthenticate(client *mqtt.Client, packet packets.Packet) bool {
	if a.isOpen {
		return true
	}
	name := string(packet.Connect.Username)
	kept, isKnown := a.users[name]
	if !isKnown || !a.isRight(kept, packet.Connect.Password) {
		return false
	}
	return !packet.Connect.WillFlag || a.mayWrite(name, packet.Connect.WillTopic)
}

func (a *access) isRight(kept secret, password []byte) bool {
	a.hashing.Lock()
	defer a.hashing.Unlock()
	hash, err := pbkdf2.Key(sha512.New, string(password), kept.salt, kept.iterations, len(kept.hash))
	return err == nil && subtle.ConstantTimeCompare(hash, kept.hash) == 1
}

// OnACLCheck is asked for every topic that is written, every filter that is subscribed and every topic that is sent.
func (a *access) OnACLCheck(client *mqtt.Client, topic string, isWrite bool) bool {
	if a.isOpen || isWrite && client.Properties.ProtocolVersion < 5 {
		return true // the latter: OnPublish
	}
	if isWrite {
		return a.mayWrite(string(client.Properties.Username), topic)
	}
	own := a.rights[string(client.Properties.Username)]
	return own != nil && isAny(own.read, withoutShare(topic))
}

// OnPublish acknowledges what an MQTT 3.1.1 client may not write, and drops it, as mosquitto does: that protocol has no
// word for it, and the library would close the connection.
func (a *access) OnPublish(client *mqtt.Client, packet packets.Packet) (packets.Packet, error) {
	if !a.isOpen && !client.Net.Inline && !a.mayWrite(string(client.Properties.Username), packet.TopicName) {
		return packet, packets.CodeSuccessIgnore
	}
	return packet, nil
}

func (a *access) mayWrite(user, topic string) bool {
	own := a.rights[user]
	return own != nil && isAny(own.write, strings.Split(topic, "/"))
}

func isAny(filters [][]string, topic []string) bool {
	for _, filter := range filters {
		if overlap(filter, topic) {
			return true
		}
	}
	return false
}

// withoutShare is the filter of a shared subscription (`$share/<group>/<filter>`), or what it is given, in levels.
func withoutShare(filter string) []string {
	levels := strings.Split(filter, "/")
	if levels[0] == "$share" && len(levels) > 2 {
		return levels[2:]
	}
	return levels
}

// overlap is true if there is a topic that both filters match; a topic is a filter without wildcards.
func overlap(a, b []string) bool {
	isOfBroker := strings.HasPrefix(a[0], "$") || strings.HasPrefix(b[0], "$") // which no wildcard matches (4.7.2)
	if isOfBroker && a[0] != b[0] {
		return false
	}
	for i := 0; i < len(a) || i < len(b); i++ {
		switch {
		case i < len(a) && a[i] == "#", i < len(b) && b[i] == "#":
			return true
		case i == len(a) || i == len(b):
			return false
		case a[i] != b[i] && a[i] != "+" && b[i] != "+":
			return false
		}
	}
	return true
}
