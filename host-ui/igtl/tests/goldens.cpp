// Writes the example messages with libOpenIGTLink into the folder given: the bytes that the codec must produce.
// Build: g++ -I/usr/include/openigtlink goldens.cpp -lOpenIGTLink -lpthread
#include <cstdio>
#include <cstring>
#include <string>
#include <igtlImageMessage.h>
#include <igtlPointMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

static void write(igtl::MessageBase* message, const std::string& folder, const char* name) {
    message->SetDeviceName("Stylet");
    message->SetTimeStamp(1234567890u, 1u << 31);
    message->Pack();
    FILE* file = fopen((folder + "/" + name + ".bin").c_str(), "wb");
    fwrite(message->GetPackPointer(), 1, message->GetPackSize(), file);
    fclose(file);
}

static igtl::PointElement::Pointer point(const char* name, float x, float y, float z) {
    igtl::PointElement::Pointer p = igtl::PointElement::New();
    p->SetName(name);
    p->SetGroupName("Seeds");
    p->SetRGBA(255, 200, 0, 255);
    p->SetPosition(x, y, z);
    p->SetRadius(0.8f);
    p->SetOwner("Slice");
    return p;
}

int main(int, char** argv) {
    const std::string folder = argv[1];

    igtl::TransformMessage::Pointer transform = igtl::TransformMessage::New();
    igtl::Matrix4x4 m = {{0, -1, 0, 1.5f}, {1, 0, 0, -2.25f}, {0, 0, 1, 30.125f}, {0, 0, 0, 1}};
    transform->SetMatrix(m);
    write(transform, folder, "transform");

    igtl::PointMessage::Pointer points = igtl::PointMessage::New();
    igtl::PointElement::Pointer one = point("Seed 1", 1, 2, 3), two = point("Seed 2", -4, 5.5f, 6.25f);
    points->AddPointElement(one);
    points->AddPointElement(two);
    write(points, folder, "point");

    igtl::PolyDataPointArray::Pointer places = igtl::PolyDataPointArray::New();
    places->AddPoint(0, 0, 0);
    places->AddPoint(1, 0, 0);
    places->AddPoint(0, 1, 0);
    places->AddPoint(0, 0, 1);
    igtl::PolyDataCellArray::Pointer cells = igtl::PolyDataCellArray::New();
    igtlUint32 triangles[2][3] = {{0, 2, 1}, {0, 1, 3}};
    for (auto& triangle : triangles) cells->AddCell(3, triangle);
    igtl::PolyDataMessage::Pointer surface = igtl::PolyDataMessage::New();
    surface->SetPoints(places);
    surface->SetPolygons(cells);
    write(surface, folder, "polydata");

    igtl::ImageMessage::Pointer image = igtl::ImageMessage::New();
    // Spacing and unit vectors; the origin is the centre of all pixels.
    igtl::Matrix4x4 axes = {{1, 0, 0, 1.5f}, {0, 0, 1, -2.25f}, {0, -1, 0, 30.125f}, {0, 0, 0, 1}};
    const unsigned char greys[] = {0, 1, 127, 128, 254, 255};
    image->SetDimensions(3, 2, 1);
    image->SetSpacing(0.25f, 0.5f, 2.0f);
    image->SetScalarTypeToUint8();
    image->SetCoordinateSystem(igtl::ImageMessage::COORDINATE_RAS);
    image->SetMatrix(axes);
    image->AllocateScalars();
    memcpy(image->GetScalarPointer(), greys, sizeof greys);
    write(image, folder, "image");

    igtl::StatusMessage::Pointer status = igtl::StatusMessage::New();
    status->SetCode(igtl::StatusMessage::STATUS_OK);
    status->SetSubCode(-7);
    status->SetErrorName("OK!");
    status->SetStatusString("needle in tissue");
    write(status, folder, "status");

    igtl::StringMessage::Pointer text = igtl::StringMessage::New();
    text->SetString("Depth 31 mm, force 1.25 N");
    write(text, folder, "string");
}
