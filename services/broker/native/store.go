package main

import (
	"bytes"
	"encoding/json"
	"errors"
	"io/fs"
	"os"
	"path/filepath"
	"strings"
	"sync"
	"sync/atomic"
	"time"

	mqtt "github.com/mochi-mqtt/server/v2"
	"github.com/mochi-mqtt/server/v2/hooks/storage"
	"github.com/mochi-mqtt/server/v2/packets"
)

const savePause = time.Second // between two looks whether something has changed

// kept is the content of the persistence file.
type kept struct {
	Clients       []storage.Client
	Subscriptions []storage.Subscription
	Waiting       []storage.Message // unacknowledged by the client, or it was away
	Retained      []storage.Message
}

// store writes sessions that outlive their connection, and retained messages, to one file, a second after a change.
//
// A file that cannot be written is said once and tried again every second: the broker serves as before.
type store struct {
	mqtt.HookBase
	server   *mqtt.Server
	path     string
	read     kept
	isStale  atomic.Bool // the file
	saving   sync.Mutex
	written  []byte
	isFailed bool
}

func newStore(server *mqtt.Server, path string, sessions *sessions) *store {
	s := &store{server: server, path: path}
	s.load()
	for _, message := range s.read.Waiting {
		sessions.count.Store(max(sessions.count.Load(), message.Created))
	}
	return s
}

// load reads what an earlier broker has written; what cannot be read is put aside.
func (s *store) load() {
	content, err := os.ReadFile(s.path)
	if errors.Is(err, fs.ErrNotExist) {
		return
	}
	if err == nil {
		err = json.Unmarshal(content, &s.read)
	}
	if err == nil {
		s.written = content
		return
	}
	s.read = kept{}
	logLine("WARNING", "%s cannot be read (%v): starting without sessions and retained messages; it is put aside as %s.unreadable", s.path, err, s.path)
	_ = os.Rename(s.path, s.path+".unreadable")
}

func (s *store) ID() string { return "store" }

func (s *store) Provides(event byte) bool {
	return bytes.IndexByte([]byte{
		mqtt.StoredClients, mqtt.StoredSubscriptions, mqtt.StoredInflightMessages, mqtt.StoredRetainedMessages,
		mqtt.OnStarted, mqtt.OnSessionEstablished, mqtt.OnDisconnect, mqtt.OnClientExpired,
		mqtt.OnSubscribed, mqtt.OnUnsubscribed, mqtt.OnQosPublish, mqtt.OnQosComplete, mqtt.OnQosDropped,
		mqtt.OnRetainMessage, mqtt.OnRetainedExpired,
	}, event) >= 0
}

func (s *store) StoredClients() ([]storage.Client, error) { return s.read.Clients, nil }
func (s *store) StoredSubscriptions() ([]storage.Subscription, error) {
	return s.read.Subscriptions, nil
}
func (s *store) StoredInflightMessages() ([]storage.Message, error) { return s.read.Waiting, nil }
func (s *store) StoredRetainedMessages() ([]storage.Message, error) { return s.read.Retained, nil }

// OnStarted begins to save, once everything has been read.
func (s *store) OnStarted() {
	s.read = kept{}
	s.isStale.Store(true)
	go func() {
		for range time.Tick(savePause) {
			s.save()
		}
	}()
}

// What changes a session that outlives its connection, or what is retained.
func (s *store) OnSessionEstablished(*mqtt.Client, packets.Packet)             { s.isStale.Store(true) }
func (s *store) OnDisconnect(*mqtt.Client, error, bool)                        { s.isStale.Store(true) }
func (s *store) OnClientExpired(*mqtt.Client)                                  { s.isStale.Store(true) }
func (s *store) OnSubscribed(c *mqtt.Client, _ packets.Packet, _ []byte)       { s.changed(c) }
func (s *store) OnUnsubscribed(c *mqtt.Client, _ packets.Packet)               { s.changed(c) }
func (s *store) OnQosPublish(c *mqtt.Client, _ packets.Packet, _ int64, _ int) { s.changed(c) }
func (s *store) OnQosComplete(c *mqtt.Client, _ packets.Packet)                { s.changed(c) }
func (s *store) OnQosDropped(c *mqtt.Client, _ packets.Packet)                 { s.changed(c) }
func (s *store) OnRetainMessage(*mqtt.Client, packets.Packet, int64)           { s.isStale.Store(true) }
func (s *store) OnRetainedExpired(string)                                      { s.isStale.Store(true) }

func (s *store) changed(client *mqtt.Client) {
	if outlives(client) {
		s.isStale.Store(true)
	}
}

// outlives is true for a session that the client asked to be kept without a connection.
func outlives(client *mqtt.Client) bool {
	if client.Properties.ProtocolVersion < 5 {
		return !client.Properties.Clean
	}
	return client.Properties.Props.SessionExpiryInterval > 0
}

// save writes the file anew where something has changed.
func (s *store) save() {
	s.saving.Lock()
	defer s.saving.Unlock()
	if !s.isStale.Swap(false) {
		return
	}
	content, err := json.Marshal(s.now())
	if err == nil && bytes.Equal(content, s.written) {
		return
	}
	if err == nil {
		err = replace(s.path, content)
	}
	if err != nil {
		s.isStale.Store(true)
		if !s.isFailed {
			logLine("WARNING", "%s cannot be written (%v): a restart would lose sessions and retained messages; trying again every second", s.path, err)
		}
	} else {
		s.written = content
		if s.isFailed {
			logLine("WARNING", "%s is written again", s.path)
		}
	}
	s.isFailed = err != nil
}

// replace writes a file so that a crash leaves the old one or the new one.
func replace(path string, content []byte) error {
	if err := os.MkdirAll(filepath.Dir(path), 0o700); err != nil {
		return err
	}
	next := path + ".new"
	file, err := os.OpenFile(next, os.O_WRONLY|os.O_CREATE|os.O_TRUNC, 0o600)
	if err != nil {
		return err
	}
	_, err = file.Write(content)
	if err == nil {
		err = file.Sync()
	}
	if closing := file.Close(); err == nil {
		err = closing
	}
	if err == nil {
		err = os.Rename(next, path)
	}
	if err != nil {
		_ = os.Remove(next) // on a full disk its part would take the room of the next try
	}
	return err
}

func (s *store) now() kept {
	var all kept
	for _, client := range s.server.Clients.GetAll() {
		if !client.Net.Inline && outlives(client) {
			all.add(client)
		}
	}
	for topic, packet := range s.server.Topics.Retained.GetAll() {
		if !strings.HasPrefix(topic, mqtt.SysPrefix) {
			all.Retained = append(all.Retained, messageOf(packet, ""))
		}
	}
	return all
}

func (k *kept) add(client *mqtt.Client) {
	props := client.Properties.Props
	k.Clients = append(k.Clients, storage.Client{
		ID: client.ID, Listener: client.Net.Listener, Username: client.Properties.Username,
		ProtocolVersion: client.Properties.ProtocolVersion, Clean: client.Properties.Clean,
		Properties: storage.ClientProperties{
			SessionExpiryInterval: props.SessionExpiryInterval, SessionExpiryIntervalFlag: props.SessionExpiryIntervalFlag,
			ReceiveMaximum: props.ReceiveMaximum, MaximumPacketSize: props.MaximumPacketSize,
		},
	})
	for _, each := range client.State.Subscriptions.GetAll() {
		k.Subscriptions = append(k.Subscriptions, storage.Subscription{
			Client: client.ID, Filter: each.Filter, Qos: each.Qos, Identifier: each.Identifier,
			RetainHandling: each.RetainHandling, RetainAsPublished: each.RetainAsPublished, NoLocal: each.NoLocal,
		})
	}
	for _, packet := range client.State.Inflight.GetAll(false) {
		k.Waiting = append(k.Waiting, messageOf(packet, client.ID))
	}
}

func messageOf(packet packets.Packet, client string) storage.Message {
	props := packet.Properties
	return storage.Message{
		Client: client, Origin: packet.Origin, TopicName: packet.TopicName, Payload: packet.Payload,
		FixedHeader: packet.FixedHeader, PacketID: packet.PacketID, Created: packet.Created,
		Properties: storage.MessageProperties{
			PayloadFormat: props.PayloadFormat, PayloadFormatFlag: props.PayloadFormatFlag,
			MessageExpiryInterval: props.MessageExpiryInterval, ContentType: props.ContentType,
			ResponseTopic: props.ResponseTopic, CorrelationData: props.CorrelationData,
			SubscriptionIdentifier: props.SubscriptionIdentifier, User: props.User,
		},
	}
}
