#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "server/http/http_server.h"
#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::http {
namespace {

using nlohmann::json;

std::string form(const std::string& boundary, const std::vector<std::pair<std::string, std::string>>& parts) {
  std::string text;
  for (const auto& [disposition, content] : parts)
    text += "--" + boundary + "\r\nContent-Disposition: form-data; " + disposition +
            "\r\nContent-Type: application/octet-stream\r\n\r\n" + content + "\r\n";
  return text + "--" + boundary + "--\r\n";
}

std::string chunked(const std::string& body, std::size_t piece) {
  std::string text;
  for (std::size_t i = 0; i < body.size(); i += piece) {
    const std::string part = body.substr(i, piece);
    std::ostringstream size;
    size << std::hex << part.size();
    text += size.str() + ";name=value\r\n" + part + "\r\n";
  }
  return text + "0\r\nX-Trailer: ignored\r\n\r\n";
}

class Upload : public testing::Test {
 protected:
  static ServerOptions options() {
    ServerOptions options;
    options.dispatcher.max_json_bytes = 1000;
    options.dispatcher.max_upload_bytes = 1'000'000;
    return options;
  }
  RawAnswer send(const std::string& type, const std::string& body) {
    return ask(server.port(), "POST", "/upload", type.empty() ? "" : "Content-Type: " + type + "\r\n", body);
  }
  RawAnswer send_chunked(const std::string& framed) {
    return ask(server.port(), "POST", "/upload", "Transfer-Encoding: chunked\r\nConnection: close\r\n\r\n" + framed);
  }
  std::string on_disk() const {
    std::ifstream in(folder.path() / "upload.bin", std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  bool nothing_left() const { return !std::filesystem::exists(folder.path() / "upload.bin"); }

  std::string content() const {
    std::string bytes;
    for (int i = 0; i < 300'000; ++i) bytes += char(unsigned(i) * 2654435761u >> 24);
    return bytes;
  }

  support::TempDir folder;
  TestServer server{sample_routes(folder.path()), options()};
};

TEST_F(Upload, KeepsARawBodyByteForByte) {
  for (const std::string type : {"application/octet-stream", "", "application/x-www-form-urlencoded"}) {
    const auto answer = send(type, content());
    EXPECT_EQ(answer.status, 201) << answer.body;
    EXPECT_EQ(json::parse(answer.body)["on_disk"], 300'000);
    EXPECT_TRUE(on_disk() == content());
  }
}

TEST_F(Upload, KeepsAChunkedBodyByteForByte) {
  for (const std::size_t piece : {7u, 4096u, 300'000u}) {
    const auto answer = send_chunked(chunked(content(), piece));
    EXPECT_EQ(answer.status, 201) << answer.body;
    EXPECT_TRUE(on_disk() == content()) << piece;
  }
}

TEST_F(Upload, KeepsTheOneFileOfAForm) {
  const auto answer = send("multipart/form-data; boundary=XyZ",
                           form("XyZ", {{"name=\"note\"", "ignored"},
                                        {"name=\"file\"; filename=\"C:\\\\scenes/../chair.ply\"", content()}}));
  ASSERT_EQ(answer.status, 201) << answer.body;
  EXPECT_EQ(json::parse(answer.body)["filename"], "chair.ply");
  EXPECT_TRUE(on_disk() == content());
  const auto quoted = send("multipart/form-data; charset=utf-8; boundary=\"a b\"", form("a b", {}));
  EXPECT_EQ(quoted.status, 400);
  EXPECT_EQ(send("multipart/form-data; boundary=\"----WebKit/1\"",
                 form("----WebKit/1", {{"name=\"file\"; filename=\"a\"", "x--\r\n--XyZ"}}))
                .status,
            201);
  EXPECT_EQ(on_disk(), "x--\r\n--XyZ");
}

TEST_F(Upload, RefusesFormsWithoutOneFile) {
  const auto status = [&](const std::string& body) { return send("multipart/form-data; boundary=B", body).status; };
  EXPECT_EQ(status(form("B", {})), 400);
  EXPECT_EQ(status(form("B", {{"name=\"a\"", "no file"}})), 400);
  EXPECT_EQ(status(form("B", {{"name=\"a\"; filename=\"1\"", "x"}, {"name=\"b\"; filename=\"2\"", "y"}})), 400);
  EXPECT_EQ(status("not a form at all"), 400);
  EXPECT_EQ(status("--B\r\n\r\nno header\r\n--B--\r\n"), 400);
  EXPECT_EQ(send("multipart/form-data", form("B", {})).status, 400);
  const std::string whole = form("B", {{"name=\"a\"; filename=\"1\"", "content"}});
  for (std::size_t cut = 1; cut + 2 < whole.size(); cut += 3)
    EXPECT_EQ(status(whole.substr(0, cut)), 400) << "cut at " << cut;
  EXPECT_TRUE(nothing_left());
}

TEST_F(Upload, SurvivesAFormWithAnEndlessHeader) {
  const std::string body = "--B\r\nContent-Disposition: form-data; name=\"" + std::string(500'000, 'a') +
                           "\"; filename=\"x\"\r\n\r\nx\r\n--B--\r\n";
  EXPECT_EQ(send("multipart/form-data; boundary=B", body).status, 400);
  const std::string just_fits = "--B\r\nContent-Disposition: form-data; name=\"" + std::string(7'000, 'a') +
                                "\"; filename=\"x\"\r\n\r\nx\r\n--B--\r\n";
  EXPECT_EQ(send("multipart/form-data; boundary=B", just_fits).status, 201);
}

TEST_F(Upload, HandsJsonOnAsText) {
  EXPECT_EQ(send("application/json", "{\"path\":1}").body, "{\"json\":{\"path\":1}}");
}

TEST_F(Upload, RefusesABodyOverItsLimitBeforeItIsSent) {
  RawClient client(server.port());
  client.send(request(server.port(), "POST", "/upload", "Content-Length: 1000001\r\nExpect: 100-continue\r\n"));
  const auto answer = client.answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 413);
  EXPECT_NE(answer->body.find("--max-upload-bytes"), std::string::npos);
  EXPECT_EQ(send("application/json", std::string(1001, ' ')).status, 413);
  EXPECT_EQ(ask(server.port(), "POST", "/json", "Content-Type: application/json\r\n", std::string(1001, ' ')).status,
            413);
}

TEST_F(Upload, RefusesAChunkedBodyOverItsLimitWhileItArrives) {
  EXPECT_EQ(send_chunked(chunked(std::string(1'000'001, 'x'), 65536)).status, 413);
  EXPECT_TRUE(nothing_left());
  EXPECT_EQ(
      ask(server.port(), "POST", "/json",
          "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n" + chunked(std::string(1001, ' '), 100))
          .status,
      413);
}

TEST_F(Upload, TellsAClientToGoOnOnlyAfterTheGuards) {
  RawClient client(server.port());
  client.send(request(server.port(), "POST", "/upload", "Content-Length: 5\r\nExpect: 100-continue\r\n"));
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 100);
  client.send("hello");
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 201);
  EXPECT_EQ(on_disk(), "hello");
  RawClient refused(server.port());
  refused.send(request(server.port(), "POST", "/upload",
                       "Content-Length: 5\r\nExpect: 100-continue\r\nOrigin: https://evil.example\r\n"));
  EXPECT_EQ(refused.answer().value_or(RawAnswer{}).status, 403);
}

TEST_F(Upload, LeavesNothingOfABodyThatEndsEarly) {
  RawClient client(server.port());
  client.send(request(server.port(), "POST", "/upload", "Content-Length: 100\r\n") + "only so much");
  client.finish_sending();
  const auto answer = client.answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 400);
  EXPECT_TRUE(nothing_left());
  EXPECT_EQ(send("", "").status, 400) << "an empty upload";
  EXPECT_TRUE(nothing_left());
}

TEST_F(Upload, RefusesBrokenChunks) {
  const std::vector<std::string> broken{"zz\r\n",
                                        "-5\r\nhello\r\n0\r\n\r\n",
                                        "0x5\r\nhello\r\n0\r\n\r\n",
                                        "5\r\nhelloX\r\n0\r\n\r\n",
                                        "5 hello\r\n0\r\n\r\n",
                                        "ffffffffffffffffff\r\n",
                                        "\r\n",
                                        "5;" + std::string(500, 'x') + "\r\nhello\r\n0\r\n\r\n"};
  for (const std::string& framed : broken) EXPECT_EQ(send_chunked(framed).status, 400) << framed;
  std::string endless_trailer = "5\r\nhello\r\n0\r\n";
  for (int i = 0; i < 1000; ++i) endless_trailer += "X-Trailer: 0123456789\r\n";
  EXPECT_EQ(send_chunked(endless_trailer + "\r\n").status, 400);
  EXPECT_TRUE(nothing_left());
}

TEST_F(Upload, NeverTakesAnUnreadBodyForTheNextRequest) {
  const std::string hidden = request(server.port(), "DELETE", "/thing");
  RawClient client(server.port());
  client.send(request(server.port(), "POST", "/nowhere", "", hidden) + request(server.port(), "GET", "/json"));
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 404);
  const auto next = client.answer();
  EXPECT_TRUE(!next || next->body == "{\"answer\":42}");
}

}  // namespace
}  // namespace server::http
